/// cnerf render: pictures and videos of a take.

#include <sstream>
#include <utility>

#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"
#include "src/pipeline/photographs_step.h"
#include "src/pipeline/render_bake.h"
#include "src/pipeline/render_step.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct RenderArguments {
  RunFolderArguments run;
  std::string path, format, out;  ///< empty path: turntable; of a bake: cameras
  std::vector<std::string> views;
  bool photographs = false, baked = false, view_averaged = false, overwrite = false;
};

/// "png,exr" as flags. Without a format a moving camera gives a video, single views give pictures.
pipeline::RenderOutput output_of(const RenderArguments& arguments) {
  pipeline::RenderOutput output;
  const bool is_moving = arguments.path != "held-out";
  std::istringstream list(arguments.format.empty() ? (is_moving ? "mp4" : "png") : arguments.format);
  for (std::string format; std::getline(list, format, ',');) {
    bool* flag = format == "png"   ? &output.png
                 : format == "exr" ? &output.exr
                 : format == "mp4" ? &output.mp4
                                   : nullptr;
    if (flag == nullptr) throw UsageError("--format: expected png, exr or mp4, got '" + format + "'");
    *flag = true;
  }
  output.color =
      arguments.baked || arguments.view_averaged ? pipeline::ShownColor::kBaked : pipeline::ShownColor::kDecoded;
  output.view_averaged = arguments.view_averaged;
  output.overwrite = arguments.overwrite;
  return output;
}

/// A bake has no takes and no other colours than its own, and knows none of the paths that a run makes.
void refuse_what_runs_have(const RenderArguments& arguments) {
  for (const auto& [option, is_given] :
       {std::pair("--take", !arguments.run.take.empty()), std::pair("--capture", !arguments.run.capture.empty()),
        std::pair("--baked", arguments.baked), std::pair("--view-averaged", arguments.view_averaged)}) {
    if (is_given) throw UsageError(std::string(option) + ": is for a run; " + arguments.run.run + " is a bake");
  }
  for (const char* path : {"turntable", "spiral", "orbit", "held-out"}) {
    if (arguments.path == path) {
      throw UsageError("--path: of a bake expected cameras or a camera file, got '" + arguments.path + "'");
    }
  }
}

void render_bake(const RenderArguments& arguments, Reporter& reporter) {
  const fs::path bake = arguments.run.run;
  (void)resolve_config(arguments.run.config);
  refuse_what_runs_have(arguments);
  if (!arguments.format.empty() && arguments.format != "png") {
    throw UsageError("--format: expected png, as all that is rendered of a bake, got '" + arguments.format + "'");
  }
  CameraPath path = pipeline::cameras_of_bake(bake);
  if (!arguments.path.empty() && arguments.path != "cameras") path = path_from_file(arguments.path);
  const fs::path folder = (arguments.out.empty() ? bake / "renders" : fs::path(arguments.out)) / path.name;
  refuse_existing(folder, arguments.overwrite);
  pipeline::render_bake(bake, path, folder, arguments.overwrite, reporter);
}

/// What is said of photographs and of a path, but not of both.
void check_photographs(const RenderArguments& arguments) {
  if (!arguments.photographs) {
    if (!arguments.views.empty()) throw UsageError("--views: is for --photographs; --path says where else to render");
    return;
  }
  if (arguments.path != RenderArguments{}.path) {
    throw UsageError("--photographs: are rendered at their own cameras, not along --path " + arguments.path);
  }
  if (arguments.baked || arguments.view_averaged) {
    throw UsageError("--photographs: have the per-pixel colours, not those of --baked or --view-averaged");
  }
}

void render_photographs(const RenderArguments& arguments, const std::vector<std::string>& command_line,
                        Reporter& reporter) {
  const pipeline::PhotographFormat format =
      pipeline::photograph_format_named(arguments.format.empty() ? "png" : arguments.format);
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.run.run);
  const std::string take = directory.choose_take(arguments.run.take);
  pipeline::check_photographs_take(directory, take);
  const fs::path folder =
      arguments.out.empty() ? pipeline::photographs_folder(directory, take) : fs::path(arguments.out) / "photographs";
  refuse_existing(folder, arguments.overwrite);
  const pipeline::RunContext context = open_run(arguments.run, take, command_line, reporter);
  const pipeline::PhotographsJob job{take, arguments.views, folder, format, arguments.run.capture};
  pipeline::photographs_step(context, job, engines_for(context.config.device), reporter);
}

void render(const RenderArguments& arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.run.config);
  const fs::path folder = arguments.run.run;
  check_photographs(arguments);
  if (arguments.photographs) return render_photographs(arguments, command_line, reporter);
  if (!pipeline::RunDirectory(folder).exists() && fs::exists(folder / "manifest.json")) {
    return render_bake(arguments, reporter);
  }
  pipeline::RenderOutput output = output_of(arguments);
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.run.run);
  const std::string take = directory.choose_take(arguments.run.take);
  output.folder = arguments.out.empty() ? directory.renders(take) : fs::path(arguments.out);
  const pipeline::RunContext context = open_run(arguments.run, take, command_line, reporter);
  const CameraPath path =
      make_path(arguments.path.empty() ? "turntable" : arguments.path, context.capture, context.config.render);
  if (output.mp4) refuse_existing(output.folder / (path.name + ".mp4"), arguments.overwrite);
  if (output.png || output.exr) refuse_existing(output.folder / path.name, arguments.overwrite);
  pipeline::render_step(context, {take, path, output}, engines_for(context.config.device), reporter);
  reporter.next("cnerf bake " + arguments.run.run);
}

}  // namespace

Work declare_render(CLI::App& app) {
  auto arguments = std::make_shared<RenderArguments>();
  add_run_folder_options(app, arguments->run);
  app.get_option("RUN")->description("Folder of a run, or of a bake");
  app.add_option("--path", arguments->path,
                 "turntable (whichever of the next two suits), spiral, orbit, held-out, or a camera file (JSON); of a "
                 "bake instead of a run: a camera file, or cameras for all of the capture's, as png");
  app.add_flag("--photographs", arguments->photographs,
               "Write the photographs of the capture in colour instead: full size, 16 bits, their own grey");
  app.add_option("--views", arguments->views, "With --photographs: only these, comma-separated")->delimiter(',');
  app.add_option(
      "--format", arguments->format,
      "png, exr, mp4 or several, comma-separated [mp4; png for held-out and bakes]; of --photographs: png or "
      "tiff [png]");
  app.add_option("-o,--out", arguments->out, "Folder to write to; RUN/renders/TAKE if not given");
  app.add_flag("--baked", arguments->baked, "Show the colours of the bake instead of the per-pixel ones");
  app.add_flag("--view-averaged", arguments->view_averaged,
               "Show what a bake is made from: --baked colours with the mean brightness of the views that see a point");
  app.add_flag("--overwrite", arguments->overwrite, "Replace what is there");
  return [arguments](const auto& command_line) { render(*arguments, command_line); };
}

}  // namespace cnerf::app
