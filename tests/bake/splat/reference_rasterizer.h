#pragma once
/// Splats drawn the slow way: every pixel asks every splat, in double, with formulas written anew from Zwicker et al.
/// 2001 and Kerbl et al. 2023. It shares nothing with bake/splat but the struct of a splat and the limits that viewers
/// have.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "bake/splat/splat.h"
#include "src/capture/camera.h"

namespace cnerf::bake::test {

using Matrix3 = std::array<std::array<double, 3>, 3>;

inline Matrix3 product(const Matrix3& a, const Matrix3& b) {
  Matrix3 c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
  return c;
}
inline Matrix3 transposed(const Matrix3& a) {
  Matrix3 c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = a[j][i];
  return c;
}

/// By turning each axis with the product of quaternions q v q*.
inline Matrix3 matrix_of_quaternion(std::array<double, 4> q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& part : q) part /= norm;
  const auto times = [](const std::array<double, 4>& a, const std::array<double, 4>& b) {
    return std::array<double, 4>{a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                                 a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                                 a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                                 a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  };
  Matrix3 m{};
  for (int axis = 0; axis < 3; ++axis) {
    std::array<double, 4> v{};
    v[axis + 1] = 1;
    const auto turned = times(times(q, v), {q[0], -q[1], -q[2], -q[3]});
    for (int i = 0; i < 3; ++i) m[i][axis] = turned[i + 1];
  }
  return m;
}

struct ReferenceSplat {
  double depth, x, y;
  double xx, xy, yy;  ///< covariance in the picture
  double opacity;
  std::array<double, 3> color;
};

struct ReferenceOptions {
  double near = 0.01;
  double blur = 0.3;  ///< square pixels
};

/// The colour as viewers compute it, from the coefficients that files have.
inline std::array<double, 3> reference_color(const BasicSplat<double>& splat, const std::array<double, 3>& d) {
  const double x = d[0], y = d[1], z = d[2];
  const std::array<double, kShadings> basis = {-0.4886025119029199 * y,
                                               0.4886025119029199 * z,
                                               -0.4886025119029199 * x,
                                               1.0925484305920792 * x * y,
                                               -1.0925484305920792 * y * z,
                                               0.31539156525252005 * (2 * z * z - x * x - y * y),
                                               -1.0925484305920792 * x * z,
                                               0.5462742152960396 * (x * x - y * y)};
  std::array<double, 3> color{};
  for (int c = 0; c < 3; ++c) {
    color[c] = splat.color[c];
    for (int i = 0; i < kShadings; ++i) color[c] += splat.color[c] * splat.shading[i] * basis[i];
    color[c] = std::max(0.0, color[c]);
  }
  return color;
}

inline std::vector<ReferenceSplat> reference_splats(const std::vector<BasicSplat<double>>& splats,
                                                    const Intrinsics& lens, const Affined& world_from_camera,
                                                    const ReferenceOptions& options) {
  const Affined camera_from_world = world_from_camera.inverse();
  Matrix3 view{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) view[i][j] = camera_from_world.linear.rows[i][j];
  std::vector<ReferenceSplat> drawn;
  for (const BasicSplat<double>& splat : splats) {
    const Vec3d p = camera_from_world.point(splat.position);
    if (p.z <= options.near) continue;
    Matrix3 shape{};
    for (int i = 0; i < 3; ++i) shape[i][i] = std::exp(2 * splat.log_scale[i]);
    const Matrix3 turn = product(view, matrix_of_quaternion(splat.rotation));
    const Matrix3 sigma = product(product(turn, shape), transposed(turn));
    const double limit_x = 1.3 * lens.width / (2 * lens.fx), limit_y = 1.3 * lens.height / (2 * lens.fy);
    const double sx = std::clamp(p.x / p.z, -limit_x, limit_x), sy = std::clamp(p.y / p.z, -limit_y, limit_y);
    const Matrix3 slope = {{{lens.fx / p.z, 0, -lens.fx * sx / p.z}, {0, lens.fy / p.z, -lens.fy * sy / p.z}, {0, 0, 0}}};
    const Matrix3 flat = product(product(slope, sigma), transposed(slope));
    const Vec3d away = splat.position - world_from_camera.translation;
    const Vec3d d = away / length(away);
    drawn.push_back({p.z, lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy, flat[0][0] + options.blur,
                     flat[0][1], flat[1][1] + options.blur, 1 / (1 + std::exp(-splat.opacity_logit)),
                     reference_color(splat, {d.x, d.y, d.z})});
  }
  std::stable_sort(drawn.begin(), drawn.end(), [](const auto& a, const auto& b) { return a.depth < b.depth; });
  return drawn;
}

/// [H, W, 4] sRGB-encoded colour over black, and opacity.
inline std::vector<double> reference_picture(const std::vector<BasicSplat<double>>& splats, const Intrinsics& lens,
                                             const Affined& world_from_camera, const ReferenceOptions& options = {}) {
  const std::vector<ReferenceSplat> drawn = reference_splats(splats, lens, world_from_camera, options);
  std::vector<double> picture(std::size_t(lens.width) * lens.height * 4, 0);
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      double* pixel = &picture[(std::size_t(y) * lens.width + x) * 4];
      double light = 1;
      for (const ReferenceSplat& splat : drawn) {
        if (light < 1e-4) break;
        const double dx = x + 0.5 - splat.x, dy = y + 0.5 - splat.y;
        const double determinant = splat.xx * splat.yy - splat.xy * splat.xy;
        const double square = (splat.yy * dx * dx - 2 * splat.xy * dx * dy + splat.xx * dy * dy) / determinant;
        const double value = splat.opacity * std::exp(-square / 2);
        if (square > 9 || value < 1.0 / 255) continue;
        const double alpha = std::min(0.99, value);
        for (int c = 0; c < 3; ++c) pixel[c] += light * alpha * splat.color[c];
        light *= 1 - alpha;
      }
      pixel[3] = 1 - light;
    }
  }
  return picture;
}

inline BasicSplat<double> in_double(const Splat& splat) {
  SplatRow<double> row{};
  const SplatRow<float> from = row_of(splat);
  std::copy(from.begin(), from.end(), row.begin());
  return splat_of(row);
}
inline std::vector<BasicSplat<double>> in_double(const std::vector<Splat>& splats) {
  std::vector<BasicSplat<double>> all;
  for (const Splat& splat : splats) all.push_back(in_double(splat));
  return all;
}

}  // namespace cnerf::bake::test
