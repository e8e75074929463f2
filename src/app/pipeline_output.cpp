/// The steps of the pipeline that only look at a trained scene: evaluate, bake, render.

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "bake/mesh/mesh_baker.h"
#include "bake/resample.h"
#include "bake/volume_baker.h"
#include "export/bake_folder.h"
#include "export/color_origin.h"
#include "src/app/pipeline.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/usage.h"
#include "src/capture/luminance_plane.h"
#include "src/evaluate/evaluate.h"
#include "viewer/server/page_folder.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr int kSheetRows = 6;

std::unique_ptr<Scene> load_scene(const RunDirectory& directory, const std::string& take) {
  return Scene::load(directory.stage1_snapshot(), take.empty() ? fs::path() : directory.take_snapshot(take));
}

std::string colorizer_name(const RunDirectory& directory, const std::string& take) {
  const auto record = directory.take_record(take);
  return record ? record->colorizer : "";
}

void note_time(const RunDirectory& directory, const char* step, const Stopwatch& watch) {
  RunRecord record = directory.record();
  record.seconds_of_steps[step] = watch.seconds();
  directory.save(record);
}

void say_metrics(const Metrics& metrics, Reporter& reporter) {
  const ViewMetrics& mean = metrics.mean;
  std::string text = fmt::format("{} views ({}): luminance {:.2f} dB", metrics.views.size(), metrics.split,
                                 mean.psnr_luminance.value_or(0));
  if (mean.ssim) text += fmt::format(", SSIM {:.3f}", *mean.ssim);
  if (mean.psnr_rgb) text += fmt::format(", RGB {:.2f} dB", *mean.psnr_rgb);
  if (mean.ab_error) text += fmt::format(", ab error {:.2f} (all grey {:.2f})", *mean.ab_error, *mean.ab_error_grey);
  if (mean.bake_ab_distance) text += fmt::format(", baked colour {:.2f} ab from per-pixel", *mean.bake_ab_distance);
  reporter.say(text);
}

void say_estimate(const Scene& scene, const std::vector<BakePlan>& plans, Reporter& reporter) {
  for (const BakePlan& plan : plans) {
    const BakeEstimate estimate = estimate_bake(scene, plan);
    reporter.say(
        fmt::format("bake: {} x {} x {} voxels of {:.4g}, at most {:.1f} M of them filled; about {:.1f} GiB of memory",
                    plan.resolution.x, plan.resolution.y, plan.resolution.z, plan.voxel_size,
                    1e-6 * double(estimate.voxels), double(estimate.memory_bytes) / (1 << 30)));
  }
  reporter.say(
      fmt::format("bake: Cycles will take about {:.2f} GiB for them", double(cycles_bytes(plans)) / (1 << 30)));
}

std::vector<BakeCamera> cameras_of(const Capture& capture) {
  std::vector<BakeCamera> cameras;
  for (const View& view : capture.views) cameras.push_back({view.name, view.intrinsics, view.world_from_camera});
  return cameras;
}

/// The photographs as the program sees them, or none.
std::vector<WebPhoto> web_photos(const Capture& capture, const WebOptions& options) {
  std::vector<WebPhoto> photos;
  if (options.photo_side == 0) return photos;
  for (const View& view : capture.views) {
    photos.push_back(
        make_web_photo(view.intrinsics, luminance_plane(view.image), options.photo_side, options.photo_quality));
  }
  return photos;
}

/// The files of one render, opened as pictures come.
class RenderFiles {
 public:
  RenderFiles(const RenderOutput& output, const std::string& path_name, const std::string& color_origin, int fps,
              Reporter& reporter)
      : output_(output),
        color_origin_(color_origin),
        frames_(output.folder / path_name),
        video_path_(output.folder / (path_name + ".mp4")),
        video_(video_path_, fps),
        with_video_(output.mp4),
        with_png_(output.png),
        reporter_(reporter) {}

  void add(const std::string& name, const RenderedImage& image) {
    const Picture picture = picture_of(image, output_.color);
    if (with_video_ && !video_.add(picture)) give_video_up();
    if (with_png_) write_png(frames_ / (name + ".png"), picture);
    if (output_.exr) write_exr(frames_ / (name + ".exr"), image, output_.color, color_origin_);
  }

  void finish() {
    if (with_video_) {
      video_.finish();
      reporter_.wrote("video", video_path_);
    }
    if (with_png_ || output_.exr) reporter_.wrote("pictures", frames_);
  }

 private:
  void give_video_up() {
    reporter_.say("note: this OpenCV has no MPEG-4 encoder; writing PNG pictures instead of a video");
    with_video_ = false;
    with_png_ = true;
  }

  const RenderOutput& output_;
  std::string color_origin_;
  fs::path frames_, video_path_;
  VideoFile video_;
  bool with_video_, with_png_;
  Reporter& reporter_;
};

}  // namespace

void evaluate_step(const RunContext& context, const std::string& take) {
  const RunDirectory& directory = context.directory;
  const Stopwatch watch;
  const auto scene = load_scene(directory, take);
  EvaluateOptions options;
  options.render = render_options(context.config);
  ContactSheet sheet({"input", "ours", "truth"});
  const auto add_to_sheet = [&](const EvaluatedView& view) {
    if (sheet.rows() >= kSheetRows) return;
    const Picture truth =
        view.truth ? picture_from_linear(view.truth->width, view.truth->height, view.truth->rgb) : Picture{};
    sheet.add_row({grey_picture(view.view.image), picture_of(view.ours, ShownColor::kDecoded), truth});
  };
  Metrics metrics = evaluate(*scene, context.capture, options, add_to_sheet, context.reporter.sink());
  metrics.take = take;
  metrics.colorizer = colorizer_name(directory, take);

  const std::string json = to_json(metrics);
  if (!take.empty()) write_file(directory.take_folder(take) / "metrics.json", json);
  write_file(directory.metrics_file(), json);
  write_png(directory.contact_sheet(), sheet.compose());
  say_metrics(metrics, context.reporter);
  context.reporter.wrote("metrics", directory.metrics_file());
  context.reporter.wrote("before and after", directory.contact_sheet());
  note_time(directory, "evaluate", watch);
}

BakeFormats parse_bake_formats(const std::string& list) {
  BakeFormats formats;
  std::istringstream words(list);
  for (std::string format; std::getline(words, format, ',');) {
    bool* flag = format == "vdb"    ? &formats.vdb
                 : format == "gltf" ? &formats.gltf
                 : format == "exr"  ? &formats.exr
                 : format == "web"  ? &formats.web
                                    : nullptr;
    if (flag == nullptr) throw UsageError("--format: expected vdb, gltf, exr or web, got '" + format + "'");
    *flag = true;
  }
  if (!formats.vdb && !formats.gltf && !formats.exr && !formats.web) {
    throw UsageError("--format: expected vdb, gltf, exr or web, got none");
  }
  formats.gltf = formats.gltf || formats.exr;
  return formats;
}

fs::path web_folder(const fs::path& bake) {
  return bake / "web";
}

fs::path last_file(const fs::path& folder, const BakeFormats& formats) {
  return formats.vdb || formats.gltf ? folder / "manifest.json" : web_folder(folder) / kWebManifest;
}

void write_web(const BakedVolume& volume, WebScene scene, const fs::path& folder, const WebOptions& options,
               Reporter& reporter) {
  const BakedVolume small = resample_volume(volume, options.resolution);
  const WebBricks bricks = make_web_bricks(small, options.density);
  const WebEstimate estimate = estimate_web(bricks);
  const auto mib = [](std::size_t bytes) { return double(bytes) / (1 << 20); };
  reporter.say(
      fmt::format("web: {} x {} x {} voxels, {} bricks; about {:.1f} MiB to load, {:.0f} MiB of graphics memory",
                  small.resolution.x, small.resolution.y, small.resolution.z, bricks.stored(),
                  mib(estimate.download_bytes), mib(estimate.texture_bytes)));
  const fs::path page = find_page();
  if (page.empty()) {
    reporter.say("note: this cnerf was built without the page (CNERF_VIEWER); the bundle holds data only");
  }
  const WebReport report = write_web_bundle(small, bricks, scene, folder, page, options);
  reporter.say(fmt::format("web: {:.2f} MiB of volume, {:.2f} MiB of photographs, {:.0f} KiB of page",
                           mib(report.volume_bytes), mib(report.photo_bytes), double(report.page_bytes) / 1024));
  reporter.wrote("web bundle", folder);
}

void bake_step(const RunContext& context, const std::string& take, const fs::path& folder, const BakeFormats& formats) {
  const Stopwatch watch;
  const auto scene = load_scene(context.directory, take);
  const Config& config = context.config;
  const std::vector<BakeCamera> cameras = cameras_of(context.capture);
  BakeFolder bake(folder, cameras, context.command_line, config.vdb.units, config.vdb.up_axis);
  BakeOptions options = config.bake;
  if (formats.web && !formats.vdb && !formats.gltf) {
    options.resolution = std::min(options.resolution, config.web.resolution);
    if (options.grids == "auto") options.grids = "one";  // the bundle would only average finer ones
  }
  const std::string colorizer = colorizer_name(context.directory, take);
  const std::vector<BakePlan> plans = plan_within_budget(*scene, cameras, options);
  say_estimate(*scene, plans, context.reporter);
  const std::vector<BakeLevel> levels = bake_levels(*scene, plans, options, context.reporter.sink());
  if (formats.vdb || formats.web) {
    std::vector<BakedVolume> volumes = bake_volumes(*scene, cameras, levels, options, context.reporter.sink());
    for (BakedVolume& volume : volumes) {
      volume.colorizer = colorizer;
      volume.take = take;
    }
    if (formats.vdb) {
      for (const fs::path& vdb : bake.add_volumes(volumes, "volume", config.vdb)) context.reporter.wrote("volume", vdb);
    }
    if (formats.web) {
      const std::string title = context.capture.root.filename().string();
      write_web(merged_volume(std::move(volumes)),
                {title, cameras, web_photos(context.capture, config.web), context.command_line, config.vdb.units,
                 config.vdb.up_axis},
                web_folder(folder), config.web, context.reporter);
    }
  }
  if (formats.gltf) {
    // A surface needs all of the density on one lattice.
    BakedMesh mesh = levels.size() == 1
                         ? bake_mesh(*scene, cameras, levels[0], options, config.mesh, context.reporter.sink())
                         : bake_mesh(*scene, cameras, options, config.mesh, context.reporter.sink());
    mesh.colorizer = colorizer;
    mesh.take = take;
    const GltfFiles files = bake.add_mesh(mesh, "mesh", {formats.exr, config.exr});
    context.reporter.say(fmt::format("mesh: {} faces, {} charts in {} x {} texels", mesh.triangles.size(), mesh.charts,
                                     mesh.texture.size, mesh.texture.size));
    context.reporter.wrote("mesh", files.glb);
    context.reporter.wrote("mesh", files.gltf);
  }
  if ((formats.vdb || formats.gltf) && config.vdb.plates) {
    constexpr int kPlateSide = 4096, kPlateQuality = 92;
    for (const View& view : context.capture.views) {
      bake.add_plate(view.name,
                     make_web_photo(view.intrinsics, luminance_plane(view.image), kPlateSide, kPlateQuality).jpeg);
    }
  }
  if (formats.vdb || formats.gltf) {
    bake.finish();
    context.reporter.wrote("Blender set-up", bake.blender_setup());
  }
  note_time(context.directory, "bake", watch);
}

void render_step(const RunContext& context, const std::string& take, const CameraPath& path,
                 const RenderOutput& output) {
  const Stopwatch watch;
  const auto scene = load_scene(context.directory, take);
  RenderOptions options = render_options(context.config);
  options.color = scene->is_colorized() && output.color == ShownColor::kDecoded;
  options.baked_color = scene->is_colorized() && output.color == ShownColor::kBaked;
  const std::string color_origin = color_origin_text(colorizer_name(context.directory, take), take);
  RenderFiles files(output, path.name, color_origin, context.config.render.fps, context.reporter);
  const ProgressSink progress = context.reporter.sink();
  for (std::size_t i = 0; i < path.cameras.size(); ++i) {
    if (interruption_requested()) throw Interrupted("rendering stopped; the video was not written");
    const PathCamera& camera = path.cameras[i];
    files.add(camera.name, scene->render(camera.intrinsics, camera.world_from_camera, options));
    progress({"render " + path.name, double(i + 1) / double(path.cameras.size()), {}});
  }
  files.finish();
  note_time(context.directory, "render", watch);
}

}  // namespace cnerf
