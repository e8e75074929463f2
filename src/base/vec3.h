#pragma once
/// Three-vectors, 3x3 matrices and affine maps, for host code and kernels alike.

#include <array>
#include <cmath>

#include "src/base/host_device.h"

namespace cnerf {

template <typename Real>
struct Vec3 {
  Real x{}, y{}, z{};

  CNERF_HD constexpr Real& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
  CNERF_HD constexpr const Real& operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  template <typename Other>
  [[nodiscard]] CNERF_HD constexpr Vec3<Other> cast() const {
    return {static_cast<Other>(x), static_cast<Other>(y), static_cast<Other>(z)};
  }
  friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;
using Vec3i = Vec3<int>;

// clang-format off
template <typename R> CNERF_HD constexpr Vec3<R> operator+(Vec3<R> a, Vec3<R> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <typename R> CNERF_HD constexpr Vec3<R> operator-(Vec3<R> a, Vec3<R> b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <typename R> CNERF_HD constexpr Vec3<R> operator-(Vec3<R> a) { return {-a.x, -a.y, -a.z}; }
template <typename R> CNERF_HD constexpr Vec3<R> operator*(Vec3<R> a, R s) { return {a.x * s, a.y * s, a.z * s}; }
template <typename R> CNERF_HD constexpr Vec3<R> operator*(R s, Vec3<R> a) { return a * s; }
template <typename R> CNERF_HD constexpr Vec3<R> operator/(Vec3<R> a, R s) { return {a.x / s, a.y / s, a.z / s}; }
template <typename R> CNERF_HD constexpr Vec3<R>& operator+=(Vec3<R>& a, Vec3<R> b) { return a = a + b; }
template <typename R> CNERF_HD constexpr Vec3<R>& operator-=(Vec3<R>& a, Vec3<R> b) { return a = a - b; }
template <typename R> CNERF_HD constexpr Vec3<R>& operator*=(Vec3<R>& a, R s) { return a = a * s; }
template <typename R> CNERF_HD constexpr R dot(Vec3<R> a, Vec3<R> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <typename R> CNERF_HD constexpr Vec3<R> cross(Vec3<R> a, Vec3<R> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <typename R> CNERF_HD R length(Vec3<R> a) { return std::sqrt(dot(a, a)); }
template <typename R> CNERF_HD Vec3<R> normalized(Vec3<R> a) { return a / length(a); }
// clang-format on

/// Row-major 3x3 matrix: `rows[i]` is the i-th row.
template <typename Real>
struct Mat3 {
  Vec3<Real> rows[3]{};

  static constexpr Mat3 identity() { return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}; }
  static constexpr Mat3 from_columns(Vec3<Real> a, Vec3<Real> b, Vec3<Real> c) {
    return {{{a.x, b.x, c.x}, {a.y, b.y, c.y}, {a.z, b.z, c.z}}};
  }
  [[nodiscard]] CNERF_HD constexpr Vec3<Real> column(int j) const { return {rows[0][j], rows[1][j], rows[2][j]}; }
  [[nodiscard]] CNERF_HD constexpr Mat3 transposed() const { return from_columns(rows[0], rows[1], rows[2]); }
  [[nodiscard]] CNERF_HD constexpr Real determinant() const { return dot(rows[0], cross(rows[1], rows[2])); }
  [[nodiscard]] CNERF_HD constexpr Mat3 inverse() const {
    const Real inv = Real(1) / determinant();
    return from_columns(cross(rows[1], rows[2]) * inv, cross(rows[2], rows[0]) * inv, cross(rows[0], rows[1]) * inv);
  }
  friend constexpr bool operator==(const Mat3&, const Mat3&) = default;
};

template <typename R>
CNERF_HD constexpr Vec3<R> operator*(const Mat3<R>& m, Vec3<R> v) {
  return {dot(m.rows[0], v), dot(m.rows[1], v), dot(m.rows[2], v)};
}
template <typename R>
CNERF_HD constexpr Mat3<R> operator*(const Mat3<R>& a, const Mat3<R>& b) {
  return Mat3<R>::from_columns(a * b.column(0), a * b.column(1), a * b.column(2));
}
template <typename R>
CNERF_HD constexpr Mat3<R> operator*(const Mat3<R>& a, R s) {
  return {{a.rows[0] * s, a.rows[1] * s, a.rows[2] * s}};
}

/// The rotation of a quaternion w x y z of length 1.
template <typename Real>
[[nodiscard]] Mat3<Real> rotation_of(const std::array<Real, 4>& q) {
  const auto [w, x, y, z] = q;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
           {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
           {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}

using Mat3d = Mat3<double>;

/// Affine map `target = linear * source + translation`. Named `target_from_source`, so products read by cancellation.
template <typename Real>
struct Affine {
  Mat3<Real> linear = Mat3<Real>::identity();
  Vec3<Real> translation{};

  [[nodiscard]] CNERF_HD constexpr Vec3<Real> point(Vec3<Real> p) const { return linear * p + translation; }
  [[nodiscard]] CNERF_HD constexpr Vec3<Real> direction(Vec3<Real> d) const { return linear * d; }
  [[nodiscard]] CNERF_HD constexpr Affine inverse() const {
    const Mat3<Real> inv = linear.inverse();
    return {inv, -(inv * translation)};
  }
  friend constexpr bool operator==(const Affine&, const Affine&) = default;
};

template <typename R>
CNERF_HD constexpr Affine<R> operator*(const Affine<R>& a, const Affine<R>& b) {
  return {a.linear * b.linear, a.point(b.translation)};
}

using Affined = Affine<double>;

}  // namespace cnerf
