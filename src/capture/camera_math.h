#pragma once
/// The lens models' arithmetic, shared with kernels; camera.h says what the functions mean.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "src/base/host_device.h"
#include "src/capture/camera.h"

namespace cnerf::lens {

inline constexpr int kNewtonSteps = 30;
inline constexpr double kNewtonTolerance = 1e-13;

/// A position on the plane z = 1, in camera axes.
template <typename Real>
struct PlanePointOf {
  Real x{}, y{};
};
using PlanePoint = PlanePointOf<double>;

/// A distorted point and its derivatives with respect to the undistorted one.
struct Distorted {
  PlanePoint value;
  double dx_dx = 1, dx_dy = 0, dy_dx = 0, dy_dy = 1;
  double radial_slope = 1;  ///< derivative of the distorted radius by the radius, radial part only
};

/// Brown-Conrady with OpenCV's rational denominator: the radial factor at s = r^2.
template <typename Real>
CNERF_HD Real radial_factor(const std::array<Real, 8>& c, Real s) {
  return (1.0 + s * (c[0] + s * (c[1] + s * c[4]))) / (1.0 + s * (c[5] + s * (c[6] + s * c[7])));
}
/// Where the lens shows a position, whose radial factor is given.
template <typename Real>
CNERF_HD PlanePointOf<Real> distorted(const std::array<Real, 8>& c, PlanePointOf<Real> p, Real radial) {
  const Real &p1 = c[2], &p2 = c[3], s = p.x * p.x + p.y * p.y;
  return {p.x * radial + 2.0 * p1 * p.x * p.y + p2 * (s + 2.0 * p.x * p.x),
          p.y * radial + p1 * (s + 2.0 * p.y * p.y) + 2.0 * p2 * p.x * p.y};
}

/// The same with its derivatives.
CNERF_HD inline Distorted distort(const std::array<double, 8>& c, PlanePoint p) {
  const double k1 = c[0], k2 = c[1], p1 = c[2], p2 = c[3], k3 = c[4], k4 = c[5], k5 = c[6], k6 = c[7];
  const double s = p.x * p.x + p.y * p.y;
  const double lower = 1 + s * (k4 + s * (k5 + s * k6));
  const double radial = radial_factor(c, s);
  // Derivative by s = r^2.
  const double slope = ((k1 + s * (2 * k2 + 3 * s * k3)) - radial * (k4 + s * (2 * k5 + 3 * s * k6))) / lower;
  Distorted out;
  out.value = distorted(c, p, radial);
  out.dx_dx = radial + 2 * p.x * p.x * slope + 2 * p1 * p.y + 6 * p2 * p.x;
  out.dx_dy = 2 * p.x * p.y * slope + 2 * p1 * p.x + 2 * p2 * p.y;
  out.dy_dx = out.dx_dy;
  out.dy_dy = radial + 2 * p.y * p.y * slope + 6 * p1 * p.y + 2 * p2 * p.x;
  out.radial_slope = radial + 2 * s * slope;
  return out;
}

CNERF_HD inline PlanePoint undistort(const std::array<double, 8>& c, PlanePoint target) {
  PlanePoint p = target;
  for (int step = 0; step < kNewtonSteps; ++step) {
    const Distorted d = distort(c, p);
    const double error_x = d.value.x - target.x;
    const double error_y = d.value.y - target.y;
    const double determinant = d.dx_dx * d.dy_dy - d.dx_dy * d.dy_dx;
    if (std::abs(determinant) < 1e-12) break;  // the fold of the model: no better answer exists
    const double move_x = (d.dy_dy * error_x - d.dx_dy * error_y) / determinant;
    const double move_y = (d.dx_dx * error_y - d.dy_dx * error_x) / determinant;
    p = {p.x - move_x, p.y - move_y};
    if (std::abs(move_x) + std::abs(move_y) < kNewtonTolerance) break;
  }
  return p;
}

/// Distance from the principal point, in focal lengths, of a ray at angle `theta` to the axis.
template <typename Real>
CNERF_HD Real fisheye_distance(const std::array<Real, 8>& k, Real theta) {
  const Real s = theta * theta;
  return theta * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
}
/// The same, and its derivative.
struct FisheyeRadius {
  double value = 0, slope = 0;
};
CNERF_HD inline FisheyeRadius fisheye_radius(const std::array<double, 8>& k, double theta) {
  const double s = theta * theta;
  return {fisheye_distance(k, theta), 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])))};
}

CNERF_HD inline double fisheye_angle(const std::array<double, 8>& k, double radius) {
  constexpr double pi = std::numbers::pi;
  const double most = pi;
  double theta = std::min(radius, most);
  for (int step = 0; step < kNewtonSteps; ++step) {
    const FisheyeRadius r = fisheye_radius(k, theta);
    if (std::abs(r.slope) < 1e-12) break;
    const double move = (r.value - radius) / r.slope;
    theta = std::clamp(theta - move, 0.0, most);
    if (std::abs(move) < kNewtonTolerance) break;
  }
  return theta;
}

CNERF_HD inline Vec3d fisheye_direction(const std::array<double, 8>& k, PlanePoint p) {
  const double radius = std::hypot(p.x, p.y);
  if (radius < 1e-12) return {0, 0, 1};
  const double theta = fisheye_angle(k, radius);
  const double across = std::sin(theta) / radius;
  return {p.x * across, p.y * across, std::cos(theta)};
}

/// See `cnerf::ray_direction`.
CNERF_HD inline Vec3d ray_direction(const Intrinsics& intrinsics, PixelPosition pixel) {
  const PlanePoint p = {(pixel.x - intrinsics.cx) / intrinsics.fx, (pixel.y - intrinsics.cy) / intrinsics.fy};
  if (intrinsics.model == LensModel::kOpenCvFisheye) return fisheye_direction(intrinsics.distortion, p);
  const PlanePoint straight = intrinsics.model == LensModel::kPinhole ? p : undistort(intrinsics.distortion, p);
  return normalized(Vec3d{straight.x, straight.y, 1.0});
}

CNERF_HD inline std::optional<PlanePoint> fisheye_project(const std::array<double, 8>& k, Vec3d point) {
  const double across = std::hypot(point.x, point.y);
  const FisheyeRadius r = fisheye_radius(k, std::atan2(across, point.z));
  if (r.slope <= 0) return std::nullopt;
  const double scale = across > 0 ? r.value / across : 0.0;
  return PlanePoint{point.x * scale, point.y * scale};
}

CNERF_HD inline std::optional<PlanePoint> plane_position(const Intrinsics& intrinsics, Vec3d point) {
  if (intrinsics.model == LensModel::kOpenCvFisheye) return fisheye_project(intrinsics.distortion, point);
  const PlanePoint p = {point.x / point.z, point.y / point.z};
  if (intrinsics.model == LensModel::kPinhole) return p;
  const Distorted d = distort(intrinsics.distortion, p);
  if (d.radial_slope <= 0) return std::nullopt;
  return d.value;
}

/// See `cnerf::project`.
CNERF_HD inline std::optional<PixelPosition> project(const Intrinsics& intrinsics, Vec3d point_in_camera) {
  if (!(point_in_camera.z > 0)) return std::nullopt;
  const std::optional<PlanePoint> p = plane_position(intrinsics, point_in_camera);
  if (!p) return std::nullopt;
  return PixelPosition{intrinsics.fx * p->x + intrinsics.cx, intrinsics.fy * p->y + intrinsics.cy};
}

}  // namespace cnerf::lens
