/// The steps of the pipeline that make numbers and pictures of a trained scene: evaluate, render.

#include <fmt/format.h>

#include <algorithm>

#include "bake/view_average.h"
#include "export/color_origin.h"
#include "src/app/pipeline.h"
#include "src/app/run_scene.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/base/usage.h"
#include "src/evaluate/evaluate.h"
#include "src/picture/contact_sheet.h"
#include "src/picture/encode.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr int kSheetRows = 6;

void say_metrics(const Metrics& metrics, Reporter& reporter) {
  const ViewMetrics& mean = metrics.mean;
  std::string text = fmt::format("{} views ({}): luminance {:.2f} dB", metrics.views.size(), metrics.split,
                                 mean.psnr_luminance.value_or(0));
  if (mean.ssim) text += fmt::format(", SSIM {:.3f}", *mean.ssim);
  if (mean.psnr_rgb) text += fmt::format(", RGB {:.2f} dB", *mean.psnr_rgb);
  if (mean.lpips) text += fmt::format(", LPIPS {:.3f}", *mean.lpips);
  if (mean.ab_error) text += fmt::format(", ab error {:.2f} (all grey {:.2f})", *mean.ab_error, *mean.ab_error_grey);
  if (mean.bake_ab_distance) text += fmt::format(", baked colour {:.2f} ab from per-pixel", *mean.bake_ab_distance);
  reporter.say(text);
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

void evaluate_step(const RunContext& context, const std::string& take, const std::filesystem::path& lpips_weights) {
  const RunDirectory& directory = context.directory;
  const Stopwatch watch;
  std::optional<Lpips> lpips;
  if (!lpips_weights.empty()) lpips.emplace(lpips_weights);  // read first: what is missing costs no rendering
  const auto scene = load_scene(directory, take, context.engines);
  EvaluateOptions options;
  options.lpips = lpips ? &*lpips : nullptr;
  options.render = render_options(context.config);
  ContactSheet sheet({"input", "ours", "truth"});
  const auto add_to_sheet = [&](const EvaluatedView& view) {
    if (sheet.rows() >= kSheetRows) return;
    const Picture truth =
        view.truth ? picture_from_linear(view.truth->width, view.truth->height, view.truth->rgb) : Picture{};
    sheet.add_row({grey_picture(view.view.image), picture_of(view.ours, ShownColor::kDecoded), truth});
  };
  Metrics metrics = evaluate(*scene, context.capture, options, add_to_sheet, context.reporter.progress_sink());
  metrics.take = take;
  metrics.colorizer = colorizer_name(directory, take);

  const std::string json = to_json(metrics).dump(2) + "\n";
  if (!take.empty()) write_file(directory.take_folder(take) / "metrics.json", json);
  write_file(directory.metrics_file(), json);
  write_png(directory.contact_sheet(), sheet.compose());
  say_metrics(metrics, context.reporter);
  context.reporter.wrote("metrics", directory.metrics_file());
  context.reporter.wrote("before and after", directory.contact_sheet());
  note_time(directory, "evaluate", watch);
}

void render_step(const RunContext& context, const std::string& take, const CameraPath& path,
                 const RenderOutput& output) {
  const Stopwatch watch;
  const auto scene = load_scene(context.directory, take, context.engines);
  RenderOptions options = render_options(context.config);
  options.color = scene->is_colorized() && output.color == ShownColor::kDecoded;
  options.baked_color = scene->is_colorized() && output.color == ShownColor::kBaked;
  std::unique_ptr<ViewAverage> average;
  if (output.view_averaged) {
    average =
        make_view_average(*scene, cameras_of(context.capture), context.config.bake, context.reporter.progress_sink());
    options.luminance = [&average](auto positions, auto luminance) { average->query(positions, luminance); };
  }
  const std::string color_origin = color_origin_text(colorizer_name(context.directory, take), take);
  RenderFiles files(output, path.name, color_origin, context.config.render.fps, context.reporter);
  const ProgressSink progress = context.reporter.progress_sink();
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
