/// cnerf run: a capture in, a colour volume out.

#include "src/app/command.h"
#include "src/app/common_options.h"
#include "src/app/default_colorizer.h"
#include "src/app/known_color_files.h"
#include "src/app/pipeline.h"
#include "src/app/prepare_step.h"
#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

struct RunArguments {
  ConfigArguments config;
  std::string capture, out, format = "vdb";
  bool grey = false;
  ExistingOutput existing;
  std::vector<std::string> command_line;
};

Config config_of(const RunArguments& arguments) {
  const RunDirectory directory(arguments.out);
  const bool goes_on = arguments.existing.resume && directory.exists();
  return resolve_config(arguments.config, goes_on ? directory.config() : Config{});
}

/// Outputs of an earlier, interrupted call that need not be made again.
bool is_done(const RunArguments& arguments, const fs::path& output) {
  return arguments.existing.resume && fs::exists(output);
}

bool needs_colorizer(const RunArguments& arguments, const RunDirectory& directory) {
  if (arguments.grey) return false;
  const bool is_colorized = directory.exists() && !directory.record().current_take.empty();
  return !(arguments.existing.resume && is_colorized);
}

void turntable(const RunArguments& arguments, const RunContext& context, const std::string& take) {
  const fs::path folder = context.directory.renders(take);
  if (is_done(arguments, folder / "turntable.mp4")) return;
  RenderOutput output;
  output.folder = folder;
  output.mp4 = true;
  render_step(context, take, turntable_path(context.capture, context.config.render), output);
}

void run(RunArguments arguments) {
  (void)parse_bake_formats(arguments.format);  // a wrong one should not cost an hour
  Reporter reporter = make_reporter(arguments.config);
  Config config = config_of(arguments);
  check_run_folder(RunDirectory(arguments.out), arguments.existing);
  if (!arguments.grey) choose_colorizer(arguments.capture, config, reporter);
  arguments.capture = capture_of(arguments.capture, arguments.out, reporter).string();

  Capture capture = read_capture(arguments.capture, config, reporter);
  RunContext context{RunDirectory(arguments.out), config,   std::move(capture),
                     arguments.command_line,      reporter, engines_for(config.device)};
  // Made before the training: what cannot be made or read should not cost an hour.
  if (!arguments.grey) (void)load_known_colors(context.capture, context.config.colorizer);
  auto colorizer = needs_colorizer(arguments, context.directory) ? colorizer_of(context) : nullptr;
  begin_run(context, arguments.capture, arguments.existing);
  train_step(context, arguments.existing.resume);

  std::string take;
  if (!arguments.grey) {
    take = take_to_write(context, "", arguments.existing);
    colorize_step(context, take, arguments.existing, std::move(colorizer));
  }
  if (!is_done(arguments, context.directory.metrics_file())) evaluate_step(context, take);
  const BakeFormats formats = parse_bake_formats(arguments.format);
  const fs::path bake = context.directory.bakes(take);
  if (!is_done(arguments, last_file(bake, formats))) bake_step(context, take, bake, formats);
  turntable(arguments, context, take);
  reporter.next("cnerf view " + arguments.out);
  if (formats.vdb || formats.gltf) reporter.next("blender --python " + (bake / "blender_setup.py").string());
}

}  // namespace

Work declare_run(CLI::App& app) {
  auto arguments = std::make_shared<RunArguments>();
  app.add_option("CAPTURE", arguments->capture,
                 "Folder of photographs and camera poses; without poses, or a film clip, it is prepared first")
      ->required();
  app.add_option("-o,--out", arguments->out, "Folder of the run, made if needed")->required();
  add_colorizer_options(app, arguments->config);
  app.add_flag("--grey", arguments->grey, "Stay grey: no colorizer");
  app.add_option("--format", arguments->format, "What to bake: vdb, gltf, exr, web or several, comma-separated");
  add_short_form(app, arguments->config, "--downscale", "capture.downscale", "Divide image sizes by this");
  add_short_form(app, arguments->config, "--holdout", "capture.holdout", "Keep every N-th view for evaluation");
  add_short_form(app, arguments->config, "--transfer", "capture.transfer", "How grey values encode luminance");
  app.add_flag("--resume", arguments->existing.resume, "Go on with a run that was stopped");
  app.add_flag("--overwrite", arguments->existing.overwrite, "Start again where a run is already");
  add_config_options(app, arguments->config);
  return [arguments](const auto& command_line) {
    arguments->command_line = command_line;
    run(*arguments);
  };
}

}  // namespace cnerf
