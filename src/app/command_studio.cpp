/// cnerf studio: a run painted and coloured in the browser.

#include <fmt/format.h>

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"
#include "src/studio/studio.h"
#include "viewer/server/live_session.h"
#include "viewer/server/page_folder.h"

namespace cnerf::app {
namespace {

struct StudioArguments {
  RunFolderArguments run;
  web::BrowserOptions browser;
};

void open_studio(const StudioArguments& arguments, const std::vector<std::string>& command_line) {
  web::check_web_server_options(arguments.browser.server);
  Reporter reporter = make_reporter(arguments.run.config);
  const std::filesystem::path page = web::find_page();
  if (page.empty()) {
    throw MissingInputError("the page was not built: install npm, run npm ci --prefix viewer, build again");
  }
  const pipeline::RunContext context = open_run(arguments.run, "", command_line, reporter);
  const std::string take = context.directory.choose_take(arguments.run.take);
  studio::Studio studio(context, take, engines_for(context.config.device), reporter);
  web::WebServer server({page}, arguments.browser.server, nullptr, &studio);
  server.start();
  reporter.say("view: " + server.address());
  reporter.say("Ctrl-C ends it; what is painted is saved as it is made");
  if (!arguments.browser.no_browser && arguments.browser.server.token.empty()) web::open_browser(server.address());
  studio.run();
}

}  // namespace

Work declare_studio(CLI::App& app) {
  auto arguments = std::make_shared<StudioArguments>();
  add_run_folder_options(app, arguments->run);
  add_browser_options(app, arguments->browser);
  return [arguments](const auto& command_line) { open_studio(*arguments, command_line); };
}

}  // namespace cnerf::app
