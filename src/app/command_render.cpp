/// cnerf render: pictures and videos of a take.

#include <algorithm>
#include <sstream>

#include "bake/volume/integrate.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "export/web_pictures.h"
#include "src/app/command.h"
#include "src/app/run_arguments.h"
#include "src/base/error.h"
#include "src/base/progress.h"
#include "src/picture/encode.h"
#include "src/pipeline/render_step.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

struct RenderArguments {
  RunFolderArguments run;
  std::string path = "turntable", format, out;
  bool baked = false, view_averaged = false, overwrite = false;
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
  return output;
}

/// Pictures of a bake, straight from its voxels: what every viewer of it should show.
void render_bake(const RenderArguments& arguments, Reporter& reporter) {
  const fs::path bake = arguments.run.run;
  if (!arguments.format.empty() && arguments.format != "png") {
    throw UsageError("--format: expected png, as all that is rendered of a bake, got '" + arguments.format + "'");
  }
  const exporting::BakeManifest manifest = exporting::read_manifest(bake / "manifest.json");
  if (!manifest.volume)
    throw InputError(bake / "manifest.json", "volume", "this bake has none; bake with --format vdb");
  CameraPath path{"cameras", {}};
  if (arguments.path == "cameras" || arguments.path == RenderArguments{}.path) {
    for (const bake::Camera& camera : manifest.cameras) {
      std::string name = fs::path(camera.name).replace_extension().string();
      std::ranges::replace(name, '/', '_');
      path.cameras.push_back({name, without_distortion(camera.intrinsics), camera.world_from_camera});
    }
  } else {
    path = path_from_file(arguments.path);
  }
  const fs::path folder = (arguments.out.empty() ? bake / "renders" : fs::path(arguments.out)) / path.name;
  refuse_existing(folder, arguments.overwrite);
  const std::vector<bake::Volume> volumes = exporting::read_volumes(bake);
  const ProgressSink progress = reporter.progress_sink();
  for (std::size_t i = 0; i < path.cameras.size(); ++i) {
    const PathCamera& camera = path.cameras[i];
    const bake::VolumeImage image = integrate_volumes(volumes, camera.intrinsics, camera.world_from_camera);
    write_png(folder / (camera.name + ".png"), picture_from_linear(image.width, image.height, image.rgb));
    progress({"render", double(i + 1) / double(path.cameras.size()), {}});
    if (interruption_requested()) throw Interrupted("stopped");
  }
  reporter.wrote("pictures", folder);
}

void render(const RenderArguments& arguments, const std::vector<std::string>& command_line) {
  Reporter reporter = make_reporter(arguments.run.config);
  const fs::path folder = arguments.run.run;
  if (!pipeline::RunDirectory(folder).exists() && fs::exists(folder / "manifest.json")) {
    return render_bake(arguments, reporter);
  }
  pipeline::RenderOutput output = output_of(arguments);
  const pipeline::RunDirectory directory = pipeline::RunDirectory::open(arguments.run.run);
  const std::string take = directory.choose_take(arguments.run.take);
  output.folder = arguments.out.empty() ? directory.renders(take) : fs::path(arguments.out);
  const pipeline::RunContext context = open_run(arguments.run, take, command_line, reporter);
  const CameraPath path = make_path(arguments.path, context.capture, context.config.render);
  if (output.mp4) refuse_existing(output.folder / (path.name + ".mp4"), arguments.overwrite);
  if (output.png || output.exr) refuse_existing(output.folder / path.name, arguments.overwrite);
  pipeline::render_step(context, {take, path, output}, engines_for(context.config.device), reporter);
  reporter.next("cnerf bake " + arguments.run.run);
}

}  // namespace

Work declare_render(CLI::App& app) {
  auto arguments = std::make_shared<RenderArguments>();
  add_run_folder_options(app, arguments->run);
  app.add_option("--path", arguments->path,
                 "turntable (whichever of the next two suits), spiral, orbit, held-out, or a camera file (JSON); of a "
                 "bake instead of a run: a camera file, or cameras for all of the capture's, as png");
  app.add_option("--format", arguments->format, "png, exr, mp4 or several, comma-separated");
  app.add_option("-o,--out", arguments->out, "Folder to write to; RUN/renders/TAKE if not given");
  app.add_flag("--baked", arguments->baked, "Show the colours of the bake instead of the per-pixel ones");
  app.add_flag("--view-averaged", arguments->view_averaged,
               "Show what a bake is made from: --baked colours with the mean brightness of the views that see a point");
  app.add_flag("--overwrite", arguments->overwrite, "Replace what is there");
  return [arguments](const auto& command_line) { render(*arguments, command_line); };
}

}  // namespace cnerf::app
