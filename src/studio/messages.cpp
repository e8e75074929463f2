#include "src/studio/messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "src/base/error.h"
#include "src/capture/arrangement.h"

namespace cnerf::studio {
namespace {

constexpr int kLargestSide = 4096;
constexpr double kFarthest = 1e9;  // world units
constexpr double kRotationError = 1e-3;

void require(bool holds, const char* field, const std::string& problem) {
  if (!holds) throw InputError("frame", field, problem);
}

Triple triple(Vec3d v) {
  return {v.x, v.y, v.z};
}

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
  ViewMessage message{view.name, view.held_out, view.intrinsics.width, view.intrinsics.height, {}, {}, {}};
  const Intrinsics& lens = view.intrinsics;
  message.lens = {lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy};
  message.position = triple(view.world_from_camera.translation);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      message.rotation[std::size_t(row)][std::size_t(column)] = view.world_from_camera.linear.column(column)[row];
    }
  }
  return message;
}

}  // namespace

FieldCamera camera_of(const FrameMessage& message) {
  const LensMessage& lens = message.lens;
  require(lens.width >= 1 && lens.width <= kLargestSide && lens.height >= 1 && lens.height <= kLargestSide, "lens",
          fmt::format("expected 1 to {} pixels, got {} x {}", kLargestSide, lens.width, lens.height));
  const double side = std::max(lens.width, lens.height);
  require(lens.fx > 0.01 * side && lens.fx < 1000 * side && lens.fy > 0.01 * side && lens.fy < 1000 * side, "lens.fx",
          "no focal length of such a picture");
  require(std::abs(lens.cx) < 10 * side && std::abs(lens.cy) < 10 * side, "lens.cx", "lies far off the picture");
  FieldCamera camera{{LensModel::kPinhole, lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy, {}}, {}};
  Vec3d columns[3];
  for (int c = 0; c < 3; ++c) {
    const auto i = std::size_t(c);
    columns[c] = {message.rotation[0][i], message.rotation[1][i], message.rotation[2][i]};
    require(std::abs(length(columns[c]) - 1) < kRotationError, "rotation", "is no rotation");
    require(std::abs(message.position[i]) < kFarthest, "position", "is too far away");
  }
  require(length(cross(columns[0], columns[1]) - columns[2]) < 2 * kRotationError, "rotation", "is no rotation");
  camera.world_from_camera.linear = Mat3d::from_columns(columns[0], columns[1], columns[2]);
  camera.world_from_camera.translation = {message.position[0], message.position[1], message.position[2]};
  return camera;
}

SceneMessage scene_of(const Capture& capture, const std::string& run) {
  const CameraArrangement cameras = arrangement_of(capture);
  SceneMessage scene{capture.root.filename().string(), run, axis_name(cameras.up), triple(cameras.focus), 1, {}, 0};
  scene.radius = mean_distance(capture.views, cameras.focus);
  for (const View& view : capture.views) scene.views.push_back(message_of(view));
  const auto middle = capture.views.begin() + std::ptrdiff_t(capture.views.size() / 2);
  const auto home = std::find_if(middle, capture.views.end(), [](const View& view) { return !view.held_out; });
  scene.home = int((home == capture.views.end() ? capture.views.begin() : home) - capture.views.begin());
  return scene;
}

}  // namespace cnerf::studio
