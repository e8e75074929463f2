#pragma once
/// What stage 1 learns about a lens that views share.

#include <cmath>

#include "src/base/host_device.h"
#include "src/capture/camera_math.h"

namespace cnerf {

/// Zeros leave a lens as it was given.
struct LensCorrection {
  float log_focal = 0;   ///< ln of both focal lengths over those given
  float x = 0, y = 0;    ///< how far the principal point moves, in focal lengths as given
  float k1 = 0, k2 = 0;  ///< added to the radial distortion; not to that of a fisheye
  float p1 = 0, p2 = 0;  ///< added to the tangential distortion; likewise

  [[nodiscard]] CNERF_HD Intrinsics applied_to(const Intrinsics& given) const {
    Intrinsics lens = given;
    lens.cx += double(x) * given.fx;
    lens.cy += double(y) * given.fy;
    lens.fx *= std::exp(double(log_focal));
    lens.fy *= std::exp(double(log_focal));
    if (lens.model == LensModel::kOpenCvFisheye || (k1 == 0 && k2 == 0 && p1 == 0 && p2 == 0)) return lens;
    lens.model = LensModel::kOpenCv;  // a pinhole's numbers are zeros
    lens.distortion[0] += double(k1);
    lens.distortion[1] += double(k2);
    lens.distortion[2] += double(p1);
    lens.distortion[3] += double(p2);
    return lens;
  }
  /// Both: this, and then one of the lens that it leaves.
  [[nodiscard]] CNERF_HD LensCorrection followed_by(const LensCorrection& next) const {
    const float focal = std::exp(log_focal);  // in which the next one counts
    return {log_focal + next.log_focal,
            x + focal * next.x,
            y + focal * next.y,
            k1 + next.k1,
            k2 + next.k2,
            p1 + next.p1,
            p2 + next.p2};
  }
};
inline constexpr int kLensNumbers = 7;  ///< of a lens's correction

/// The gradient of a loss by a lens's correction, in its numbers' order.
struct LensGradient {
  float by[kLensNumbers] = {};

  /// Adds what a ray adds.
  /// @param lens          as it is: corrected
  /// @param given         as it was given
  /// @param direction     of the ray, camera axes, unit length
  /// @param by_direction  the gradient by it, camera axes
  CNERF_HD void add(const Intrinsics& lens, const Intrinsics& given, Vec3d direction, Vec3d by_direction) {
    if (lens.model == LensModel::kOpenCvFisheye) return add_fisheye(lens, direction, by_direction);
    // The ray meets the plane z = 1 at (u, v), whose distorted place is linear in the pixel's. A number that moves the
    // distorted place, or the distortion itself, moves (u, v) by the inverse of the distortion's derivative J.
    const lens::PlanePoint place = {direction.x / direction.z, direction.y / direction.z};
    const double along = dot(by_direction, direction);
    const double by_u = (by_direction.x - along * direction.x) * direction.z;
    const double by_v = (by_direction.y - along * direction.y) * direction.z;
    const lens::Distorted at = lens::distort(lens.distortion, place);
    const double determinant = at.dx_dx * at.dy_dy - at.dx_dy * at.dy_dx;
    if (!(std::abs(determinant) > 1e-6)) return;  // the fold of the model
    const double by_x = (at.dy_dy * by_u - at.dy_dx * by_v) / determinant;
    const double by_y = (at.dx_dx * by_v - at.dx_dy * by_u) / determinant;
    const double u = place.x, v = place.y, s = u * u + v * v;
    const std::array<double, 8>& c = lens.distortion;
    const double lower = 1 + s * (c[5] + s * (c[6] + s * c[7]));
    const double radial = (by_x * u + by_y * v) * s / lower;
    by[0] -= float(by_x * at.value.x + by_y * at.value.y);
    by[1] -= float(by_x * given.fx / lens.fx);
    by[2] -= float(by_y * given.fy / lens.fy);
    by[3] -= float(radial);
    by[4] -= float(radial * s);
    by[5] -= float(by_x * 2 * u * v + by_y * (s + 2 * v * v));
    by[6] -= float(by_x * (s + 2 * u * u) + by_y * 2 * u * v);
  }
  CNERF_HD LensGradient& operator+=(const LensGradient& other) {
    for (int i = 0; i < kLensNumbers; ++i) by[i] += other.by[i];
    return *this;
  }

 private:
  /// Of its focal length alone, which moves the angle to the axis.
  CNERF_HD void add_fisheye(const Intrinsics& lens, Vec3d direction, Vec3d by_direction) {
    const double across = std::hypot(direction.x, direction.y);
    if (across < 1e-9) return;
    const lens::FisheyeRadius radius = lens::fisheye_radius(lens.distortion, std::atan2(across, direction.z));
    if (!(radius.slope > 1e-6)) return;
    const Vec3d by_angle = {direction.z * direction.x / across, direction.z * direction.y / across, -across};
    by[0] -= float(radius.value / radius.slope * dot(by_direction, by_angle));
  }
};

/// How far each number moves the picture's corner, in focal lengths: what makes them learn at one pace (in the manner
/// of CamP, Park et al. 2023, but for the corner alone).
CNERF_HD inline void corner_motions(const Intrinsics& lens, float motion[kLensNumbers]) {
  const auto r = float(std::hypot(0.5 * lens.width / lens.fx, 0.5 * lens.height / lens.fy));
  const float of[kLensNumbers] = {r, 1, 1, r * r * r, r * r * r * r * r, r * r, r * r};
  for (int i = 0; i < kLensNumbers; ++i) motion[i] = of[i];
}

}  // namespace cnerf
