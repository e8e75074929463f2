#include "src/capture/camera.h"

#include "src/base/check.h"
#include "src/capture/camera_math.h"

namespace cnerf {
namespace {

using lens::distort;
using lens::Distorted;
using lens::fisheye_radius;
using lens::FisheyeRadius;
using lens::PlanePoint;

std::optional<PlanePoint> fisheye_project(const std::array<double, 8>& k, Vec3d point) {
  const double across = std::hypot(point.x, point.y);
  const FisheyeRadius r = fisheye_radius(k, std::atan2(across, point.z));
  if (r.slope <= 0) return std::nullopt;
  const double scale = across > 0 ? r.value / across : 0.0;
  return PlanePoint{point.x * scale, point.y * scale};
}

std::optional<PlanePoint> plane_position(const Intrinsics& intrinsics, Vec3d point) {
  if (intrinsics.model == LensModel::kOpenCvFisheye) return fisheye_project(intrinsics.distortion, point);
  const PlanePoint p = {point.x / point.z, point.y / point.z};
  if (intrinsics.model == LensModel::kPinhole) return p;
  const Distorted d = distort(intrinsics.distortion, p);
  if (d.radial_slope <= 0) return std::nullopt;
  return d.value;
}

}  // namespace

Vec3d ray_direction(const Intrinsics& intrinsics, PixelPosition pixel) {
  return lens::ray_direction(intrinsics, pixel);
}

std::optional<PixelPosition> project(const Intrinsics& intrinsics, Vec3d point_in_camera) {
  if (!(point_in_camera.z > 0)) return std::nullopt;
  const std::optional<PlanePoint> p = plane_position(intrinsics, point_in_camera);
  if (!p) return std::nullopt;
  return PixelPosition{intrinsics.fx * p->x + intrinsics.cx, intrinsics.fy * p->y + intrinsics.cy};
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
