/// cnerf colorize: stage 2, one take of colours for a trained run.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/default_colorizer.h"
#include "viewer/server/live_session.h"

namespace cnerf::app {
namespace {

struct ColorizeArguments {
  RunFolderArguments run;
  pipeline::ExistingOutput existing;
  std::string bases;
  bool bases_only = false;
  bool view = false;
  web::BrowserOptions browser;
};

void colorize(const ColorizeArguments& arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.run.config);
  // A take that is gone on with has its own configuration; a new one starts from the run's.
  const std::string base = arguments.existing.resume ? arguments.run.take : "";
  pipeline::RunContext context = open_run(arguments.run, base, command_line, reporter);
  refuse_colorizer_of_others(arguments.run.config, context.config);
  const Engines& engines = engines_for(context.config.device);
  pipeline::choose_colorizer(context.capture.root, context.config, reporter);
  if (!arguments.bases.empty()) context.config.stage2.purify.picked_bases = arguments.bases;
  if (arguments.bases_only) {
    pipeline::show_bases(context, engines, reporter);
    reporter.next("cnerf colorize " + arguments.run.run + " --bases 2,5,7");
    return;
  }
  const std::string take = pipeline::take_to_write(context, arguments.run.take, arguments.existing);
  std::optional<web::LiveSession> live;
  if (arguments.view) {
    live.emplace("Colorizing " + context.capture.root.filename().string() + ", take " + take, arguments.browser,
                 reporter);
  }
  Observer& observer = live ? static_cast<Observer&>(*live) : reporter;
  pipeline::colorize_step(context, {take, arguments.existing}, engines, observer);
  reporter.next("cnerf bake " + arguments.run.run + " --take " + take);
}

}  // namespace

Work declare_colorize(CLI::App& app) {
  auto arguments = std::make_shared<ColorizeArguments>();
  add_run_folder_options(app, arguments->run);
  add_colorizer_options(app, arguments->run.config);
  app.add_option("--bases", arguments->bases,
                 "2,5,7: base images whose colours you like, by their numbers in bases.png");
  app.add_flag("--bases-only", arguments->bases_only, "Only show the candidates of base images, in a minute");
  app.add_flag("--resume", arguments->existing.resume, "Go on with a take that was stopped");
  app.add_flag("--overwrite", arguments->existing.overwrite, "Start again where a take of this name is finished");
  app.add_flag("--view", arguments->view, "Show the work in the browser, with buttons to pause and to stop");
  add_browser_options(app, arguments->browser);
  return [arguments](const auto& command_line) { colorize(*arguments, command_line); };
}

}  // namespace cnerf::app
