/// cnerf studio: from photographs to a coloured scene, in the browser.

#include <fmt/format.h>

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"
#include "src/prepare/prepare.h"
#include "src/studio/messages.h"
#include "src/studio/reception.h"
#include "src/studio/studio.h"
#include "viewer/server/live_session.h"
#include "viewer/server/page_folder.h"
#include "viewer/server/page_relay.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

constexpr const char* kDefaultRun = "cnerf-studio";

struct StudioArguments {
  RunFolderArguments run;  ///< `run.run`: a run, or what one is made of; empty: the page sends it
  std::string out;
  web::BrowserOptions browser;

  /// The folder of the run.
  [[nodiscard]] fs::path folder() const {
    if (run.run.empty()) return out.empty() ? kDefaultRun : out;
    if (pipeline::RunDirectory(run.run).exists()) return run.run;
    if (!out.empty()) return out;
    return output_beside(run.run, "run");
  }
};

void check(const StudioArguments& arguments) {
  web::check_web_server_options(arguments.browser.server);
  const std::string& what = arguments.run.run;
  std::error_code failure;
  if (!what.empty() && !fs::exists(what, failure)) {
    throw MissingInputError(what + ": no such file or folder; cnerf studio -o " + what + " begins with nothing there");
  }
  if (web::find_page().empty()) {
    throw MissingInputError("the page was not built: install npm, run npm ci --prefix viewer, build again");
  }
}

pipeline::RunContext begin_run(const StudioArguments& arguments, const std::vector<std::string>& command_line,
                               const fs::path& capture, Observer& observer) {
  const Config config = resolve_config(arguments.run.config);
  pipeline::RunContext context{pipeline::RunDirectory(arguments.folder()), config,
                               pipeline::read_capture(capture, config, observer, arguments.folder()), command_line};
  const FolderLock lock = pipeline::claim_run_folder(context.directory, {}, observer);
  pipeline::begin_run(context, capture, {});
  return context;
}

void open_studio(StudioArguments arguments, const std::vector<std::string>& command_line) {
  check(arguments);
  arguments.browser.server.name = studio::name_of_run(arguments.folder());
  Reporter reporter = make_reporter(arguments.run.config);
  const pipeline::RunDirectory directory(arguments.folder());
  std::optional<pipeline::RunContext> context;
  web::PageRelay stages("/studio");
  std::shared_ptr<studio::Reception> reception;
  std::shared_ptr<studio::Studio> studio;
  const auto open = [&] {
    std::optional<std::string> take;
    if (!arguments.run.take.empty()) take = directory.choose_take(arguments.run.take);
    studio = std::make_shared<studio::Studio>(*context, take, engines_for(context->config.device), reporter);
    stages.enter(studio);
  };
  if (directory.exists()) {
    arguments.run.run = directory.root().string();
    context = open_begun_run(arguments.run, "", command_line, reporter);
    open();
  } else {
    // Refuses now what it would refuse after an upload.
    const bool prepares = arguments.run.run.empty() || prepare::needs_preparing(arguments.run.run);
    if (resolve_config(arguments.run.config).capture.transfer != "srgb" && prepares) {
      throw UsageError(
          "capture.transfer: cnerf studio takes photographs as sRGB; make a capture of others by cnerf prepare");
    }
    pipeline::check_run_folder(directory, {});
    const auto begin = [&](const fs::path& capture, Observer& observer) {
      return begin_run(arguments, command_line, capture, observer);
    };
    reception = std::make_shared<studio::Reception>(arguments.run.run, directory.root(), begin, reporter);
    stages.enter(reception);
  }
  web::WebServer server({web::find_page()}, arguments.browser.server, nullptr, &stages);
  server.start();
  reporter.say("view: " + server.address());
  reporter.say("Ctrl-C ends it; what is painted is saved as it is made");
  if (!arguments.browser.no_browser && arguments.browser.server.token.empty()) web::open_browser(server.address());
  if (reception) {
    context = reception->run();
    if (!context) return;
    open();
  }
  studio->run();
}

}  // namespace

Work declare_studio(CLI::App& app) {
  auto arguments = std::make_shared<StudioArguments>();
  app.add_option("RUN", arguments->run.run,
                 "Folder of a run; or photographs, a clip or a capture to make one of; without it the page takes them");
  app.add_option("-o,--out", arguments->out, "Folder of a new run; beside what it is made of if not given");
  app.add_option("--capture", arguments->run.capture, "Where the capture lies now, if it was moved");
  app.add_option("--take", arguments->run.take,
                 "Name of a colorization; if not given, what was shown last and is in none yet, else the last one");
  add_config_options(app, arguments->run.config);
  add_browser_options(app, arguments->browser);
  return [arguments](const auto& command_line) { open_studio(*arguments, command_line); };
}

}  // namespace cnerf::app
