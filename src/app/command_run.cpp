/// cnerf run: a capture in, a colour volume out.

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/pipeline/run.h"

namespace cnerf::app {
namespace {

struct RunArguments {
  ConfigArguments config;
  std::string format = "vdb";
  pipeline::RunJob job;
};

void run(RunArguments arguments, const std::vector<std::string>& command_line) {
  pipeline::RunJob& job = arguments.job;
  job.formats = exporting::parse_formats(arguments.format);
  job.command_line = command_line;
  Reporter reporter = make_reporter(arguments.config);
  job.out = chosen_output(job.out, output_beside(job.capture, "run"), reporter);
  const pipeline::RunDirectory directory(job.out);
  const bool goes_on = job.existing.resume && directory.exists();
  const Config config = resolve_config(arguments.config, goes_on ? directory.config("", reporter) : Config{});
  refuse_colorizer_of_others(arguments.config, config);
  const auto bake = pipeline::run(job, config, engines_for(config.device), reporter);
  reporter.next("cnerf view " + job.out.string());
  if (job.formats.is_for_blender()) {
    reporter.next("blender --python " + (bake / "blender_setup.py").string());
  }
}

}  // namespace

Work declare_run(CLI::App& app) {
  auto arguments = std::make_shared<RunArguments>();
  pipeline::RunJob& job = arguments->job;
  app.add_option("CAPTURE", job.capture,
                 "Folder of photographs and camera poses; without poses, or a film clip, it is prepared first")
      ->required();
  app.add_option("-o,--out", job.out, "Folder of the run, made if needed; CAPTURE-run if not given");
  add_colorizer_options(app, arguments->config);
  app.add_flag("--grey", job.grey, "Stay grey: no colorizer");
  app.add_option("--format", arguments->format,
                 "What to bake: vdb, gltf, exr, web, splat or several, comma-separated [vdb]");
  add_short_form(app, arguments->config, "--downscale", "capture.downscale");
  add_short_form(app, arguments->config, "--holdout", "capture.holdout");
  add_short_form(app, arguments->config, "--transfer", "capture.transfer");
  app.add_flag("--resume", job.existing.resume, "Go on with a run that was stopped");
  app.add_flag("--overwrite", job.existing.overwrite, "Start again where a run is already");
  add_config_options(app, arguments->config);
  return [arguments](const auto& command_line) { run(*arguments, command_line); };
}

}  // namespace cnerf::app
