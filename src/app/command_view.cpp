/// cnerf view: a bake, a web bundle or a run in the browser.

#include <thread>

#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/base/error.h"
#include "src/pipeline/shown_bundle.h"
#include "viewer/server/live_session.h"
#include "viewer/server/page_folder.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct ViewArguments {
  ConfigArguments config;
  web::BrowserOptions browser;
  std::string what, take;
};

void view(const ViewArguments& arguments, const std::vector<std::string>& command_line) {
  web::check_web_server_options(arguments.browser.server);
  Reporter reporter = make_reporter(arguments.config);
  const Config config = resolve_config(arguments.config);
  const fs::path bundle =
      pipeline::bundle_to_show({arguments.what, arguments.take, command_line}, config.web, reporter);
  const fs::path page = web::find_page();
  if (page.empty() && !fs::exists(bundle / "index.html")) {
    throw MissingInputError("the viewer's page was not built: install npm, run npm ci --prefix viewer, build again");
  }
  // The program's own page first: a bundle may hold an older one.
  std::vector<fs::path> folders{bundle};
  if (!page.empty()) folders.insert(folders.begin(), page);
  web::WebServer server(folders, arguments.browser.server);
  server.start();
  reporter.say("view: " + server.address());
  reporter.say("Ctrl-C ends it");
  if (!arguments.browser.no_browser && arguments.browser.server.token.empty()) web::open_browser(server.address());
  while (!interruption_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
}

}  // namespace

Work declare_view(CLI::App& app) {
  auto arguments = std::make_shared<ViewArguments>();
  app.add_option("WHAT", arguments->what, "Folder of a bake, of a web bundle or of a run")->required();
  app.add_option("--take", arguments->take, "Of a run: name of a colorization; the last one if not given");
  add_browser_options(app, arguments->browser);
  add_short_form(app, arguments->config, "--web-resolution", "web.resolution");
  add_config_options(app, arguments->config);
  return [arguments](const auto& command_line) { view(*arguments, command_line); };
}

}  // namespace cnerf::app
