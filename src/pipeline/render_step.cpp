#include "src/pipeline/render_step.h"

#include "bake/color/view_average.h"
#include "bake/provenance.h"
#include "src/base/error.h"
#include "src/base/usage.h"
#include "src/picture/encode.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

/// The files of one render, opened as pictures come.
class RenderFiles {
 public:
  RenderFiles(const RenderOutput& output, const std::string& path_name, const std::string& color_origin, int fps,
              Observer& observer)
      : output_(output),
        color_origin_(color_origin),
        frames_(output.folder / path_name),
        video_path_(output.folder / (path_name + ".mp4")),
        video_(video_path_, fps),
        with_video_(output.mp4),
        with_png_(output.png),
        observer_(observer) {}

  void add(const std::string& name, const RenderedImage& image) {
    const Picture picture = picture_of(image, output_.color);
    if (with_video_ && !video_.add(picture)) give_video_up();
    if (with_png_) write_png(frames_ / (name + ".png"), picture);
    if (output_.exr) write_exr(frames_ / (name + ".exr"), image, output_.color, color_origin_);
  }

  void finish() {
    if (with_video_) {
      video_.finish();
      observer_.wrote("video", video_path_);
    }
    if (with_png_ || output_.exr) observer_.wrote("pictures", frames_);
  }

 private:
  void give_video_up() {
    observer_.say("note: this OpenCV has no MPEG-4 encoder; writing PNG pictures instead of a video");
    with_video_ = false;
    with_png_ = true;
  }

  const RenderOutput& output_;
  std::string color_origin_;
  fs::path frames_, video_path_;
  VideoFile video_;
  bool with_video_, with_png_;
  Observer& observer_;
};

}  // namespace

void render_step(const RunContext& context, const RenderJob& job, const Engines& engines, Observer& observer) {
  const RenderOutput& output = job.output;
  const StepLocks locks(context.directory, output.folder, observer);
  const Stopwatch watch;
  const auto scene = load_scene(context.directory, job.take, context.config.finish, engines);
  RenderOptions options = render_options(context.config);
  options.color = scene->is_colorized() && output.color == ShownColor::kDecoded;
  options.baked_color = scene->is_colorized() && output.color == ShownColor::kBaked;
  std::unique_ptr<bake::ViewAverage> average;
  if (output.view_averaged) {
    average = make_view_average(*scene, bake::cameras_of(context.capture), context.config.bake, engines, observer);
    options.luminance = [&average](auto positions, auto luminance) { average->query(positions, luminance); };
  }
  const std::string color_origin = bake::color_origin_text(colorizer_name(context.directory, job.take), job.take);
  RenderFiles files(output, job.path.name, color_origin, context.config.render.fps, observer);
  const ProgressSink progress = observer.progress_sink();
  for (std::size_t i = 0; i < job.path.cameras.size(); ++i) {
    if (observer.is_cancelled()) throw Interrupted("rendering stopped; the video was not written");
    const PathCamera& camera = job.path.cameras[i];
    files.add(camera.name, scene->render(camera.intrinsics, camera.world_from_camera, options));
    progress({"render " + job.path.name, double(i + 1) / double(job.path.cameras.size()), {}});
  }
  files.finish();
  note_time(context.directory, "render", watch);
}

RenderOptions render_options(const Config& config) {
  RenderOptions options;
  options.steps_per_box = config.render.steps_per_box;
  return options;
}

}  // namespace cnerf::pipeline
