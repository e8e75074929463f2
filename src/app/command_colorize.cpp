/// cnerf colorize: stage 2, one take of colours for a trained run.

#include "src/app/command.h"
#include "src/app/default_colorizer.h"
#include "src/app/live_session.h"
#include "src/app/run_arguments.h"

namespace cnerf {
namespace {

struct ColorizeArguments {
  RunFolderArguments run;
  ExistingOutput existing;
  std::string bases;
  bool bases_only = false;
  bool view = false;
  BrowserArguments browser;
};

void colorize(const ColorizeArguments& arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.run.config);
  // A take that is gone on with has its own configuration; a new one starts from the run's.
  const std::string base = arguments.existing.resume ? arguments.run.take : "";
  RunContext context = open_run(arguments.run, base, command_line, reporter);
  choose_colorizer(context.capture.root, context.config, reporter);
  if (!arguments.bases.empty()) context.config.stage2.purify.picked_bases = arguments.bases;
  if (arguments.bases_only) {
    show_bases(context);
    return;
  }
  const std::string take = take_to_write(context, arguments.run.take, arguments.existing);
  std::optional<LiveSession> live;
  if (arguments.view) {
    live.emplace("Colorizing " + context.capture.root.filename().string() + ", take " + take, arguments.browser,
                 reporter);
    context.watcher = &*live;
  }
  colorize_step(context, take, arguments.existing);
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

}  // namespace cnerf
