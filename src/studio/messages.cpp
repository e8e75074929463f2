#include "src/studio/messages.h"

#include <algorithm>
#include <cmath>

#include "src/base/absolute_folder.h"
#include "src/capture/arrangement.h"

namespace cnerf::studio {
namespace {

constexpr int kLargestSide = 4096;  // of a frame

/// The signed axis nearest to a direction: "+y".
std::string axis_name(Vec3d direction) {
  const Triple along = triple(direction);
  std::size_t axis = 0;
  for (std::size_t i = 1; i < 3; ++i) {
    if (std::abs(along[i]) > std::abs(along[axis])) axis = i;
  }
  return std::string(along[axis] < 0 ? "-" : "+") + "xyz"[axis];
}

ViewMessage message_of(const View& view) {
  return {view.name, view.held_out, view.intrinsics.width, view.intrinsics.height,
          camera_record(view.intrinsics, view.world_from_camera)};
}

}  // namespace

FieldCamera camera_of(const CameraRecord& camera) {
  return {camera.intrinsics(), camera.world_from_camera()};
}

FieldCamera camera_of(const FrameMessage& message) {
  check_camera(message.camera, kLargestSide, "frame", "");
  return camera_of(message.camera);
}

std::string name_of_run(const std::filesystem::path& root) {
  return absolute_folder(root).string();
}

SceneMessage scene_of(const Capture& capture, const std::string& run) {
  const CameraArrangement cameras = arrangement_of(capture);
  const std::string name = absolute_folder(capture.root).filename().string();
  SceneMessage scene{name, run, axis_name(cameras.up), triple(cameras.focus), 1, {}, 0};
  scene.radius = mean_distance(capture.views, cameras.focus);
  for (const View& view : capture.views) scene.views.push_back(message_of(view));
  const auto middle = capture.views.begin() + std::ptrdiff_t(capture.views.size() / 2);
  const auto home = std::find_if(middle, capture.views.end(), [](const View& view) { return !view.held_out; });
  scene.home = int((home == capture.views.end() ? capture.views.begin() : home) - capture.views.begin());
  return scene;
}

}  // namespace cnerf::studio
