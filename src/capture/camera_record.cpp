#include "src/capture/camera_record.h"

#include <fmt/format.h>

#include "src/base/error.h"
#include "src/capture/pose.h"

namespace cnerf {

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
  const auto refuse = [&](const std::string& field, const std::string& problem) {
    throw InputError(file, where + field, problem);
  };
  const auto check_side = [&](int side, const char* field) {
    if (side < 1 || side > largest_side)
      refuse(field, fmt::format("expected 1 to {} pixels, got {}", largest_side, side));
  };
  check_side(camera.lens.width, "lens.width");
  check_side(camera.lens.height, "lens.height");
  const Affined pose = camera.world_from_camera();
  if (const auto found = implausible_number(camera.intrinsics(), pose.translation))
    refuse(found->field, found->problem);
  (void)rigid_pose(pose, file, where + "rotation");
}

}  // namespace cnerf
