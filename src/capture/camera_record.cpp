#include "src/capture/camera_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "src/base/error.h"

namespace cnerf {
namespace {

constexpr double kFarthest = 1e9;  // world units
constexpr double kRotationError = 1e-3;

}  // namespace

Triple triple(Vec3d v) {
  return {v.x, v.y, v.z};
}

Intrinsics CameraRecord::intrinsics() const {
  return {LensModel::kPinhole, lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy, {}};
}

Affined CameraRecord::world_from_camera() const {
  const auto column = [&](std::size_t c) { return Vec3d{rotation[0][c], rotation[1][c], rotation[2][c]}; };
  return {Mat3d::from_columns(column(0), column(1), column(2)), {position[0], position[1], position[2]}};
}

CameraRecord camera_record(const Intrinsics& lens, const Affined& world_from_camera) {
  CameraRecord camera;
  camera.position = triple(world_from_camera.translation);
  for (std::size_t row = 0; row < 3; ++row) camera.rotation[row] = triple(world_from_camera.linear.rows[row]);
  camera.lens = {lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy};
  return camera;
}

void check_camera(const CameraRecord& camera, int largest_side, const std::filesystem::path& file,
                  const std::string& where) {
  const auto require = [&](bool holds, const char* field, const std::string& problem) {
    if (!holds) throw InputError(file, where + field, problem);
  };
  const LensRecord& lens = camera.lens;
  const auto check_side = [&](int side, const char* field) {
    require(side >= 1 && side <= largest_side, field,
            fmt::format("expected 1 to {} pixels, got {}", largest_side, side));
  };
  check_side(lens.width, "lens.width");
  check_side(lens.height, "lens.height");
  const double side = std::max(lens.width, lens.height);
  const auto check_focal = [&](double f, const char* field) {
    require(f > 0.01 * side && f < 1000 * side, field, fmt::format("no focal length of such a picture: {}", f));
  };
  check_focal(lens.fx, "lens.fx");
  check_focal(lens.fy, "lens.fy");
  require(std::abs(lens.cx) < 10 * side, "lens.cx", "lies far off the picture");
  require(std::abs(lens.cy) < 10 * side, "lens.cy", "lies far off the picture");
  for (const double along : camera.position) require(std::abs(along) < kFarthest, "position", "is too far away");
  const Mat3d axes = camera.world_from_camera().linear;
  for (int c = 0; c < 3; ++c) {
    require(std::abs(length(axes.column(c)) - 1) < kRotationError, "rotation", "is no rotation");
  }
  require(length(cross(axes.column(0), axes.column(1)) - axes.column(2)) < 2 * kRotationError, "rotation",
          "is no rotation");
}

}  // namespace cnerf
