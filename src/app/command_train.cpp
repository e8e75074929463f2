/// cnerf train: stage 1, luminance and density.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/absolute_folder.h"
#include "src/cluster/ranks.h"
#include "src/pipeline/train_step.h"
#include "viewer/server/live_session.h"

namespace cnerf::app {
namespace {

struct TrainArguments {
  ConfigArguments config;
  std::string capture, out;
  pipeline::ExistingOutput existing;
  bool view = false;
  web::BrowserOptions browser;
};

void train(TrainArguments arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.config);
  arguments.out = chosen_output(arguments.out, output_beside(arguments.capture, "run"), reporter).string();
  pipeline::RunDirectory directory(arguments.out);
  const bool goes_on = arguments.existing.resume && directory.exists();
  const Config config = resolve_config(arguments.config, goes_on ? directory.config("", reporter) : Config{});
  const Engines& engines = engines_for(config.device);
  const pipeline::RunContext context{
      directory, config, pipeline::read_capture(arguments.capture, config, reporter, directory.root()), command_line};
  const FolderLock lock = pipeline::claim_run_folder(directory, arguments.existing, reporter);
  std::optional<web::LiveSession> live;
  if (arguments.view && cluster::world().is_first()) {
    live.emplace("Training " + absolute_folder(context.capture.root).filename().string(), arguments.browser, reporter);
  }
  pipeline::begin_run(context, arguments.capture, arguments.existing);
  Observer& observer = live ? static_cast<Observer&>(*live) : reporter;
  pipeline::train_step(context, {arguments.existing.resume}, engines, observer);
  reporter.next("cnerf colorize " + arguments.out + " --colorizer reference:PHOTO.jpg");
}

}  // namespace

Work declare_train(CLI::App& app) {
  auto arguments = std::make_shared<TrainArguments>();
  app.add_option("CAPTURE", arguments->capture, "Folder of photographs and camera poses")->required();
  app.add_option("-o,--out", arguments->out, "Folder of the run, made if needed; CAPTURE-run if not given");
  add_short_form(app, arguments->config, "--downscale", "capture.downscale");
  add_short_form(app, arguments->config, "--holdout", "capture.holdout");
  add_short_form(app, arguments->config, "--transfer", "capture.transfer");
  app.add_flag("--resume", arguments->existing.resume, "Go on with a run that was stopped");
  app.add_flag("--overwrite", arguments->existing.overwrite, "Start again where a run is already");
  app.add_flag("--view", arguments->view, "Show the training in the browser, with buttons to pause and to stop");
  add_browser_options(app, arguments->browser);
  add_config_options(app, arguments->config);
  return [arguments](const auto& command_line) { train(*arguments, command_line); };
}

}  // namespace cnerf::app
