#pragma once
/// A splat in a picture: elliptical weighted average (Zwicker et al. 2001, "EWA Volume Splatting") as Kerbl et al. 2023
/// use it, and the derivatives. The only copy of these formulas; `Real` is float where splats are fitted and double
/// where that is tested.

#include <algorithm>
#include <cmath>
#include <optional>

#include "bake/splat/splat.h"
#include "bake/splat/tile_kernels.h"
#include "encoding/spherical_harmonics_math.h"
#include "src/capture/camera.h"

namespace cnerf::bake {

/// Variance that every viewer adds to splats in a picture, square pixels.
inline constexpr double kViewerBlur = 0.3;

/// A camera without lens distortion, which no viewer of splats has.
template <typename Real>
struct SplatCamera {
  int width = 0, height = 0;            ///< pixels
  Real fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  Affine<Real> camera_from_world;       ///< rigid; axes as camera.h says
  Vec3<Real> centre;                    ///< world
  Real near = 0;                        ///< what is nearer is not drawn; world units along the optical axis
  Real blur = Real(kViewerBlur);        ///< square pixels
};

template <typename Real>
[[nodiscard]] Vec3<Real> to_real(Vec3d v) {
  return {Real(v.x), Real(v.y), Real(v.z)};
}
/// @param blur  square pixels; of a reduced picture, what kViewerBlur of the whole one is there
template <typename Real>
[[nodiscard]] SplatCamera<Real> splat_camera(const Intrinsics& intrinsics, const Affined& world_from_camera,
                                             double near, double blur = kViewerBlur) {
  const Affined camera_from_world = world_from_camera.inverse();
  SplatCamera<Real> camera{intrinsics.width,
                           intrinsics.height,
                           Real(intrinsics.fx),
                           Real(intrinsics.fy),
                           Real(intrinsics.cx),
                           Real(intrinsics.cy),
                           {},
                           {},
                           Real(near),
                           Real(blur)};
  for (int i = 0; i < 3; ++i) {
    camera.camera_from_world.linear.rows[i] = to_real<Real>(camera_from_world.linear.rows[i]);
  }
  camera.camera_from_world.translation = to_real<Real>(camera_from_world.translation);
  camera.centre = to_real<Real>(world_from_camera.translation);
  return camera;
}

/// What a splat is in a picture: opacity exp(-(a dx^2 + c dy^2) / 2 - b dx dy) of one colour.
template <typename Real>
struct FlatSplat {
  Real x = 0, y = 0;         ///< pixels
  Real a = 0, b = 0, c = 0;  ///< the inverse covariance, 1 / square pixels
  Real opacity = 0;
  Vec3<Real> color;  ///< sRGB-encoded, >= 0
};

/// The exponent below which a splat of this opacity is left out.
template <typename Real>
[[nodiscard]] Real least_power(Real opacity) {
  return std::max(Real(-kReach * kReach / 2), Real(std::log(kLeastAlpha)) - std::log(opacity));
}

template <typename Real>
[[nodiscard]] Real sigmoid(Real x) {
  return 1 / (1 + std::exp(-x));
}
template <typename Real>
[[nodiscard]] Real logit(Real p) {
  return std::log(p / (1 - p));
}

/// Spherical harmonics of degree 1 and 2 with the signs that files of splats have (Condon and Shortley's).
template <typename Real>
[[nodiscard]] std::array<Real, kShadings> shading_functions(Vec3<Real> direction) {
  std::array<Real, kShadings> values{};
  spherical_harmonics(direction.x, direction.y, direction.z, [&](int i, Real value) {
    if (i >= 1 && i <= kShadings) values[std::size_t(i - 1)] = i % 2 == 1 ? -value : value;
  });
  return values;
}
static_assert(kShadings == 8);
/// The gradient of sum_i weights_i Y_i by the direction, as if that were of any length.
template <typename Real>
[[nodiscard]] Vec3<Real> shading_gradient(Vec3<Real> d, const std::array<Real, kShadings>& weights) {
  const Real k1 = Real(0.4886025119029199), k2 = Real(1.0925484305920792), k3 = Real(0.31539156525252005);
  Vec3<Real> sum = {-k1 * weights[2], -k1 * weights[0], k1 * weights[1]};
  sum += Vec3<Real>{d.y, d.x, 0} * (k2 * weights[3]);
  sum += Vec3<Real>{0, d.z, d.y} * (-k2 * weights[4]);
  sum += Vec3<Real>{0, 0, d.z} * (6 * k3 * weights[5]);
  sum += Vec3<Real>{d.z, 0, d.x} * (-k2 * weights[6]);
  sum += Vec3<Real>{d.x, -d.y, 0} * (k2 * weights[7]);
  return sum;
}

/// The gradient by the quaternion, of length 1, where that by the rotation is `d`.
template <typename Real>
[[nodiscard]] std::array<Real, 4> rotation_gradient(const std::array<Real, 4>& q, const Mat3<Real>& d) {
  const auto [w, x, y, z] = q;
  const auto& [r0, r1, r2] = d.rows;
  return {2 * (z * (r1.x - r0.y) + y * (r0.z - r2.x) + x * (r2.y - r1.z)),
          2 * (y * (r0.y + r1.x) + z * (r0.z + r2.x) + w * (r2.y - r1.z) - 2 * x * (r1.y + r2.z)),
          2 * (x * (r0.y + r1.x) + z * (r1.z + r2.y) + w * (r0.z - r2.x) - 2 * y * (r0.x + r2.z)),
          2 * (x * (r0.z + r2.x) + y * (r1.z + r2.y) + w * (r1.x - r0.y) - 2 * z * (r0.x + r1.y))};
}

/// The steps between a splat and what it is in a picture, which derivatives go back through.
template <typename Real>
class SplatProjection {
 public:
  /// @return  nothing where the splat is not in front of the camera.
  [[nodiscard]] static std::optional<SplatProjection> of(const BasicSplat<Real>& splat,
                                                         const SplatCamera<Real>& camera) {
    SplatProjection projection(splat, camera);
    if (!(projection.p_.z > camera.near)) return std::nullopt;
    projection.project();
    projection.shade();
    return projection;
  }

  [[nodiscard]] const FlatSplat<Real>& flat() const { return flat_; }
  [[nodiscard]] Real depth() const { return p_.z; }  ///< along the optical axis, world units
  /// Variances in the picture, square pixels.
  [[nodiscard]] Real variance_x() const { return xx_; }
  [[nodiscard]] Real variance_y() const { return yy_; }

  /// The gradient by the splat's parameters.  @param d  by `flat()`
  [[nodiscard]] BasicSplat<Real> gradient(const FlatSplat<Real>& d) const {
    BasicSplat<Real> result;
    result.position = shading_part(d, result) + projection_part(d, result);
    result.opacity_logit = d.opacity * flat_.opacity * (1 - flat_.opacity);
    return result;
  }

 private:
  SplatProjection(const BasicSplat<Real>& splat, const SplatCamera<Real>& camera)
      : splat_(splat), camera_(camera), p_(camera.camera_from_world.point(splat.position)) {}

  /// Beyond the picture's edge the projection is linearised at the edge, where it still is nearly so.
  [[nodiscard]] static Real within(Real slope, Real half_picture) {
    const Real limit = Real(1.3) * half_picture;
    return std::clamp(slope, -limit, limit);
  }

  void project() {
    const Real z = p_.z, fx = camera_.fx, fy = camera_.fy;
    flat_.x = fx * p_.x / z + camera_.cx;
    flat_.y = fy * p_.y / z + camera_.cy;
    slope_x_ = within(p_.x / z, Real(camera_.width) / (2 * fx));
    slope_y_ = within(p_.y / z, Real(camera_.height) / (2 * fy));
    j0_ = {fx / z, 0, -fx * slope_x_ / z};
    j1_ = {0, fy / z, -fy * slope_y_ / z};
    const auto& q = splat_.rotation;
    length_ = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (std::size_t i = 0; i < 4; ++i) unit_[i] = q[i] / length_;
    for (int i = 0; i < 3; ++i) scale_[i] = std::exp(splat_.log_scale[i]);
    axes_ = camera_.camera_from_world.linear * rotation_of(unit_);
    const Mat3<Real> across = axes_.transposed();
    q0_ = across * j0_;
    q1_ = across * j1_;
    b0_ = scaled(q0_);
    b1_ = scaled(q1_);
    xx_ = dot(b0_, b0_) + camera_.blur;
    xy_ = dot(b0_, b1_);
    yy_ = dot(b1_, b1_) + camera_.blur;
    const Real determinant = xx_ * yy_ - xy_ * xy_;
    flat_.a = yy_ / determinant;
    flat_.b = -xy_ / determinant;
    flat_.c = xx_ / determinant;
    flat_.opacity = sigmoid(splat_.opacity_logit);
  }

  void shade() {
    const Vec3<Real> towards = splat_.position - camera_.centre;
    distance_ = length(towards);
    direction_ = towards / distance_;
    functions_ = shading_functions(direction_);
    factor_ = 1;
    for (std::size_t i = 0; i < kShadings; ++i) factor_ += splat_.shading[i] * functions_[i];
    flat_.color = splat_.color * std::max(Real(0), factor_);
  }

  [[nodiscard]] Vec3<Real> scaled(Vec3<Real> v) const { return {v.x * scale_.x, v.y * scale_.y, v.z * scale_.z}; }

  /// @return  the gradient by the position, which shading depends on too
  Vec3<Real> shading_part(const FlatSplat<Real>& d, BasicSplat<Real>& result) const {
    if (factor_ <= 0) return {};
    result.color = d.color * factor_;
    const Real d_factor = dot(d.color, splat_.color);
    for (std::size_t i = 0; i < kShadings; ++i) result.shading[i] = d_factor * functions_[i];
    const Vec3<Real> by_direction = shading_gradient(direction_, splat_.shading) * d_factor;
    return (by_direction - direction_ * dot(direction_, by_direction)) / distance_;
  }

  /// @return  the gradient by the position
  Vec3<Real> projection_part(const FlatSplat<Real>& d, BasicSplat<Real>& result) const {
    // By the covariance: that of an inverse is -inverse d inverse; off the diagonal both elements are one variable.
    const Real a = flat_.a, b = flat_.b, c = flat_.c;
    const Real d_xx = -(a * a * d.a + a * b * d.b + b * b * d.c);
    const Real d_xy = -(2 * a * b * d.a + (a * c + b * b) * d.b + 2 * b * c * d.c);
    const Real d_yy = -(b * b * d.a + b * c * d.b + c * c * d.c);
    const Vec3<Real> d_b0 = b0_ * (2 * d_xx) + b1_ * d_xy;
    const Vec3<Real> d_b1 = b1_ * (2 * d_yy) + b0_ * d_xy;
    for (int i = 0; i < 3; ++i) result.log_scale[i] = (d_b0[i] * q0_[i] + d_b1[i] * q1_[i]) * scale_[i];
    const Vec3<Real> d_q0 = scaled(d_b0), d_q1 = scaled(d_b1);

    Mat3<Real> d_axes;
    for (int i = 0; i < 3; ++i) d_axes.rows[i] = d_q0 * j0_[i] + d_q1 * j1_[i];
    const auto by_unit = rotation_gradient(unit_, camera_.camera_from_world.linear.transposed() * d_axes);
    Real along = 0;
    for (std::size_t i = 0; i < 4; ++i) along += by_unit[i] * unit_[i];
    for (std::size_t i = 0; i < 4; ++i) result.rotation[i] = (by_unit[i] - unit_[i] * along) / length_;

    return camera_.camera_from_world.linear.transposed() * point_gradient(d, axes_ * d_q0, axes_ * d_q1);
  }

  /// By the point in camera axes.  @param d_j0, d_j1  by the rows of the projection's derivative
  [[nodiscard]] Vec3<Real> point_gradient(const FlatSplat<Real>& d, Vec3<Real> d_j0, Vec3<Real> d_j1) const {
    const Real z = p_.z, fx = camera_.fx, fy = camera_.fy;
    Vec3<Real> by_point = {d.x * fx / z, d.y * fy / z, 0};
    by_point.z = -(by_point.x * p_.x + by_point.y * p_.y) / z;
    by_point.z -= (d_j0.x * j0_.x + d_j0.z * j0_.z + d_j1.y * j1_.y + d_j1.z * j1_.z) / z;
    add_slope(-d_j0.z * fx / z, p_.x / z, slope_x_, by_point.x, by_point.z);
    add_slope(-d_j1.z * fy / z, p_.y / z, slope_y_, by_point.y, by_point.z);
    return by_point;
  }
  void add_slope(Real d_slope, Real slope, Real used, Real& by_side, Real& by_depth) const {
    if (slope != used) return;
    by_side += d_slope / p_.z;
    by_depth -= d_slope * slope / p_.z;
  }

  const BasicSplat<Real>& splat_;
  const SplatCamera<Real>& camera_;
  Vec3<Real> p_;  // in camera axes
  FlatSplat<Real> flat_;
  Real slope_x_ = 0, slope_y_ = 0, length_ = 0, distance_ = 0, factor_ = 0;
  Real xx_ = 0, xy_ = 0, yy_ = 0;  // covariance in the picture
  std::array<Real, 4> unit_{};
  Vec3<Real> scale_, j0_, j1_, q0_, q1_, b0_, b1_, direction_;
  Mat3<Real> axes_;  // camera_from_own
  std::array<Real, kShadings> functions_{};
};

}  // namespace cnerf::bake
