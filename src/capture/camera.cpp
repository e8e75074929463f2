#include "src/capture/camera.h"

#include "src/base/check.h"
#include "src/capture/camera_math.h"

namespace cnerf {

Vec3d ray_direction(const Intrinsics& intrinsics, PixelPosition pixel) {
  return lens::ray_direction(intrinsics, pixel);
}

std::optional<PixelPosition> project(const Intrinsics& intrinsics, Vec3d point_in_camera) {
  return lens::project(intrinsics, point_in_camera);
}

Intrinsics resized(const Intrinsics& intrinsics, int width, int height) {
  CNERF_CHECK(width > 0 && height > 0, "an image has pixels");
  CNERF_CHECK(intrinsics.width > 0 && intrinsics.height > 0, "the camera's own size is known");
  const double scale_x = double(width) / intrinsics.width;
  const double scale_y = double(height) / intrinsics.height;
  Intrinsics out = intrinsics;
  out.width = width;
  out.height = height;
  out.fx *= scale_x;
  out.cx *= scale_x;  // pixel borders, not centres, are integers: the principal point scales as it stands
  out.fy *= scale_y;
  out.cy *= scale_y;
  return out;
}

}  // namespace cnerf
