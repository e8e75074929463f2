#pragma once
/// What stage 1 learns about a view beside the scene: its exposure, and where its camera really stood.

#include <cmath>

#include "src/base/host_device.h"
#include "src/base/vec3.h"
#include "src/render/ray.h"

namespace cnerf {

/// Zeros leave a view as it was given.
struct ViewCorrection {
  float log_gain = 0;  ///< ln of the view's light over that of the median view
  Vec3f turn;          ///< rotation vector, unit space's axes, radians; follows the camera's own rotation
  Vec3f shift;         ///< of the camera's centre, unit space

  [[nodiscard]] CNERF_HD float gain() const { return std::exp(log_gain); }
  [[nodiscard]] CNERF_HD Ray applied_to(const Ray& ray) const;
};
inline constexpr int kViewNumbers = 7;  ///< of a view's correction

/// R v with the rotation R = exp([turn]x) (Rodrigues' formula). A turn of zero returns v to the bit.
template <typename Real>
[[nodiscard]] CNERF_HD Vec3<Real> turned(Vec3<Real> turn, Vec3<Real> v) {
  const Real squared = dot(turn, turn);
  if (squared == Real(0)) return v;
  const Real angle = std::sqrt(squared), half = std::sin(angle / 2);
  const Vec3<Real> across = cross(turn, v);
  return v + across * (std::sin(angle) / angle) + cross(turn, across) * (2 * half * half / squared);
}

/// The way back: the rotation vector of a rotation by less than half a turn.
inline Vec3d rotation_vector(const Mat3d& r) {
  const Vec3d twice = {r.rows[2].y - r.rows[1].z, r.rows[0].z - r.rows[2].x, r.rows[1].x - r.rows[0].y};
  const double sine = 0.5 * length(twice), cosine = 0.5 * (r.rows[0].x + r.rows[1].y + r.rows[2].z - 1);
  return sine < 1e-12 ? 0.5 * twice : twice * (0.5 * std::atan2(sine, cosine) / sine);
}

CNERF_HD inline Ray ViewCorrection::applied_to(const Ray& ray) const {
  return {ray.origin + shift, turned(turn, ray.direction)};
}

/// The gradient of a loss by a view's correction, with the turn's as the gradient by a further small rotation (the
/// left-trivialised one; `by_turn` makes it that of the rotation vector).
struct ViewGradient {
  float by_log_gain = 0;
  Vec3f by_rotation, by_shift;

  /// Adds what a point of a ray adds.  @param arm  from the camera's centre to the point
  CNERF_HD void add(Vec3f arm, Vec3f by_point) {
    by_shift += by_point;
    by_rotation += cross(arm, by_point);
  }
  CNERF_HD ViewGradient& operator+=(const ViewGradient& other) {
    by_log_gain += other.by_log_gain;
    by_rotation += other.by_rotation;
    by_shift += other.by_shift;
    return *this;
  }
  /// J^T g, where J = I + (1 - cos a) / a^2 [turn]x + (a - sin a) / a^3 [turn]x^2 is the left Jacobian of rotations
  /// (Sola et al. 2018, Eq. 145) and a = |turn|.
  [[nodiscard]] CNERF_HD Vec3f by_turn(Vec3f turn) const {
    const float squared = dot(turn, turn), angle = std::sqrt(squared);
    if (angle < 1e-3f) return by_rotation - 0.5f * cross(turn, by_rotation);
    const Vec3f across = cross(turn, by_rotation);
    return by_rotation - ((1 - std::cos(angle)) / squared) * across +
           ((angle - std::sin(angle)) / (squared * angle)) * cross(turn, across);
  }
};

}  // namespace cnerf
