#include "src/pipeline/render_step.h"

#include <algorithm>
#include <functional>
#include <map>
#include <utility>

#include "bake/color/view_average.h"
#include "bake/provenance.h"
#include "src/base/error.h"
#include "src/base/usage.h"
#include "src/cluster/packing.h"
#include "src/cluster/share_out.h"
#include "src/picture/encode.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

cluster::Bytes packed(const Picture& picture) {
  return cluster::Packer().add(picture.width).add(picture.height).add(picture.rgb).packed();
}

Picture unpacked(const cluster::Bytes& bytes) {
  Picture picture;
  cluster::Unpacker(bytes).get(picture.width).get(picture.height).get(picture.rgb);
  return picture;
}

void refuse_video_of_several_sizes(const CameraPath& path) {
  const auto size = [](const PathCamera& camera) {
    return std::pair(camera.intrinsics.width, camera.intrinsics.height);
  };
  if (std::ranges::adjacent_find(path.cameras, std::not_equal_to(), size) == path.cameras.end()) return;
  throw UsageError("--format mp4: the cameras of " + path.name + " have several sizes; use png");
}

constexpr double kMostWaitingBytes = 1 << 30;  // of pictures that a video shows again later

/// What to render: numbers of frames that are one picture. Where keeping pictures takes too much memory, each frame is
/// rendered.
std::vector<std::vector<std::size_t>> pictures_of(const CameraPath& path, bool is_video) {
  double bytes = 0;
  for (const PathCamera& camera : path.cameras) bytes += 3.0 * camera.intrinsics.width * camera.intrinsics.height;
  if (!is_video || bytes / 2 <= kMostWaitingBytes) return frames_of_equal_cameras(path);
  std::vector<std::vector<std::size_t>> each;
  for (std::size_t i = 0; i < path.cameras.size(); ++i) each.push_back({i});
  return each;
}

/// Names of frames that look the same.
using FrameNames = std::vector<std::string>;

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
        observer_(observer) {}

  /// The files of one picture, by whichever rank renders it.  @return  its frame of the video
  [[nodiscard]] Picture write(const FrameNames& names, const RenderedImage& image) const {
    const Picture picture = picture_of(image, output_.color);
    for (const std::string& name : names) {
      if (output_.png) write_png(frames_ / (name + ".png"), picture);
      if (output_.exr) write_exr(frames_ / (name + ".exr"), image, output_.color, color_origin_);
    }
    return output_.mp4 ? picture : Picture();
  }
  /// Frames of the video on rank 0, of which a later one may come before an earlier one.
  void add_to_video(const std::vector<std::size_t>& frames, const CameraPath& path, const Picture& picture) {
    if (!output_.mp4) return;
    for (const std::size_t frame : frames) waiting_[frame] = picture;
    for (auto next = waiting_.find(added_); next != waiting_.end(); next = waiting_.find(added_)) {
      add_to_video(path.cameras[added_++].name, next->second);
      waiting_.erase(next);
    }
  }

  void finish() {
    if (with_video_) {
      video_.finish();
      observer_.wrote("video", video_path_);
    }
    if (output_.png || output_.exr || with_video_ != output_.mp4) observer_.wrote("pictures", frames_);
  }

 private:
  void add_to_video(const std::string& name, const Picture& picture) {
    if (with_video_ && !video_.add(picture)) give_video_up();
    if (!with_video_ && !output_.png) write_png(frames_ / (name + ".png"), picture);
  }
  void give_video_up() {
    observer_.say("note: OpenCV cannot begin an MPEG-4 video; writing PNG pictures instead of a video");
    with_video_ = false;
  }

  const RenderOutput& output_;
  std::string color_origin_;
  fs::path frames_, video_path_;
  VideoFile video_;
  bool with_video_;
  std::map<std::size_t, Picture> waiting_;  ///< for frames before them
  std::size_t added_ = 0;                   ///< frames to the video
  Observer& observer_;
};

}  // namespace

void render_step(const RunContext& context, const RenderJob& job, const Engines& engines, Observer& observer) {
  const RenderOutput& output = job.output;
  if (output.mp4) refuse_video_of_several_sizes(job.path);
  const StepLocks locks(context.directory, output.folder, observer);
  const Stopwatch watch;
  const StepScene scene(job.scene, context.directory, job.take, context.config.finish, engines);
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
  const std::vector<PathCamera>& cameras = job.path.cameras;
  const std::vector<std::vector<std::size_t>> frames = pictures_of(job.path, output.mp4);
  const auto make = [&](std::size_t i) {
    if (observer.is_cancelled()) throw Interrupted("rendering stopped; the video was not written");
    FrameNames names;
    for (const std::size_t frame : frames[i]) names.push_back(cameras[frame].name);
    const PathCamera& camera = cameras[frames[i].front()];
    return files.write(names, scene->render(camera.intrinsics, camera.world_from_camera, options));
  };
  const auto take = [&](std::size_t i, const Picture& picture) {
    files.add_to_video(frames[i], job.path, picture);
    progress({"render " + job.path.name, double(i + 1) / double(frames.size()), {}});
  };
  cluster::share_out(cluster::world(), frames.size(), make, take, packed, unpacked);
  if (!cluster::world().is_first()) return;
  files.finish();
  if (output.overwrite && output.png) remove_other_frames(output.folder / job.path.name, ".png", job.path);
  if (output.overwrite && output.exr) remove_other_frames(output.folder / job.path.name, ".exr", job.path);
  note_time(context.directory, "render", watch);
}

RenderOptions render_options(const Config& config) {
  RenderOptions options;
  options.steps_per_box = config.render.steps_per_box;
  return options;
}

}  // namespace cnerf::pipeline
