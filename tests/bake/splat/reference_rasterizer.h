#pragma once
/// Splats drawn the plain way: one after another, pixel by pixel, in double, without tiles, with formulas written anew
/// from Zwicker et al. 2001 and Kerbl et al. 2023. What it draws is what files hold; of bake/splat it knows the struct
/// of a splat.

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
    return std::array<double, 4>{
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
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

/// What a file says of a splat.
struct FileSplat {
  Vec3d position, log_scale;
  std::array<double, 4> rotation{};  ///< w x y z
  double opacity_logit = 0;
  std::array<Vec3d, 9> harmonics{};  ///< red, green, blue
};

inline FileSplat file_splat(const BasicSplat<double>& splat) {
  FileSplat file{splat.position, splat.log_scale, splat.rotation, splat.opacity_logit, {}};
  file.harmonics[0] = (splat.color - Vec3d{0.5, 0.5, 0.5}) / 0.28209479177387814;
  for (std::size_t i = 0; i < 8; ++i) file.harmonics[i + 1] = splat.color * splat.shading[i];
  return file;
}

struct ReferenceOptions {
  double near = 0.01;
  double blur = 0.3;  ///< square pixels
};

/// The colour in a direction.
inline Vec3d reference_color(const FileSplat& splat, Vec3d d) {
  const auto [x, y, z] = d;
  const std::array<double, 9> basis = {0.28209479177387814,
                                       -0.4886025119029199 * y,
                                       0.4886025119029199 * z,
                                       -0.4886025119029199 * x,
                                       1.0925484305920792 * x * y,
                                       -1.0925484305920792 * y * z,
                                       0.31539156525252005 * (2 * z * z - x * x - y * y),
                                       -1.0925484305920792 * x * z,
                                       0.5462742152960396 * (x * x - y * y)};
  Vec3d color{0.5, 0.5, 0.5};
  for (std::size_t i = 0; i < basis.size(); ++i) color += splat.harmonics[i] * basis[i];
  return {std::max(0.0, color.x), std::max(0.0, color.y), std::max(0.0, color.z)};
}

/// A splat in a picture.
struct Ellipse {
  double depth, x, y;
  double xx, xy, yy;  ///< covariance
  double opacity;
  Vec3d color;
};

inline std::vector<Ellipse> ellipses_of(const std::vector<FileSplat>& splats, const Intrinsics& lens,
                                        const Affined& world_from_camera, const ReferenceOptions& options) {
  const Affined camera_from_world = world_from_camera.inverse();
  Matrix3 view{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) view[i][j] = camera_from_world.linear.rows[i][j];
  std::vector<Ellipse> ellipses;
  for (const FileSplat& splat : splats) {
    const Vec3d p = camera_from_world.point(splat.position);
    if (p.z <= options.near) continue;
    Matrix3 shape{};
    for (int i = 0; i < 3; ++i) shape[i][i] = std::exp(2 * splat.log_scale[i]);
    const Matrix3 turn = product(view, matrix_of_quaternion(splat.rotation));
    const Matrix3 sigma = product(product(turn, shape), transposed(turn));
    const double limit_x = 1.3 * lens.width / (2 * lens.fx), limit_y = 1.3 * lens.height / (2 * lens.fy);
    const double sx = std::clamp(p.x / p.z, -limit_x, limit_x), sy = std::clamp(p.y / p.z, -limit_y, limit_y);
    const Matrix3 slope = {
        {{lens.fx / p.z, 0, -lens.fx * sx / p.z}, {0, lens.fy / p.z, -lens.fy * sy / p.z}, {0, 0, 0}}};
    const Matrix3 flat = product(product(slope, sigma), transposed(slope));
    ellipses.push_back({p.z, lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy, flat[0][0] + options.blur,
                        flat[0][1], flat[1][1] + options.blur, 1 / (1 + std::exp(-splat.opacity_logit)),
                        reference_color(splat, normalized(splat.position - world_from_camera.translation))});
  }
  std::stable_sort(ellipses.begin(), ellipses.end(), [](const auto& a, const auto& b) { return a.depth < b.depth; });
  return ellipses;
}

/// [H, W, 4] sRGB-encoded colour over black, and opacity.
inline std::vector<double> reference_picture(const std::vector<FileSplat>& splats, const Intrinsics& lens,
                                             const Affined& world_from_camera, const ReferenceOptions& options = {}) {
  std::vector<double> picture(std::size_t(lens.width) * lens.height * 4, 0);
  for (const Ellipse& e : ellipses_of(splats, lens, world_from_camera, options)) {
    const double determinant = e.xx * e.yy - e.xy * e.xy;
    const double reach_x = 3 * std::sqrt(e.xx) + 1, reach_y = 3 * std::sqrt(e.yy) + 1;
    const int top = int(std::max(0.0, e.y - reach_y)), bottom = int(std::min(lens.height - 1.0, e.y + reach_y));
    const int left = int(std::max(0.0, e.x - reach_x)), right = int(std::min(lens.width - 1.0, e.x + reach_x));
    for (int y = top; y <= bottom; ++y) {
      for (int x = left; x <= right; ++x) {
        double* pixel = &picture[(std::size_t(y) * lens.width + x) * 4];
        const double light = 1 - pixel[3], dx = x + 0.5 - e.x, dy = y + 0.5 - e.y;
        const double square = (e.yy * dx * dx - 2 * e.xy * dx * dy + e.xx * dy * dy) / determinant;
        const double value = e.opacity * std::exp(-square / 2);
        if (light < 1e-4 || square > 9 || value < 1.0 / 255) continue;
        const double alpha = std::min(0.99, value);
        for (int c = 0; c < 3; ++c) pixel[c] += light * alpha * e.color[c];
        pixel[3] = 1 - light * (1 - alpha);
      }
    }
  }
  return picture;
}

inline FileSplat file_splat(const Splat& splat) {
  SplatRow<double> row{};
  const SplatRow<float> from = row_of(splat);
  std::copy(from.begin(), from.end(), row.begin());
  return file_splat(splat_of(row));
}
inline std::vector<FileSplat> file_splats(const std::vector<Splat>& splats) {
  std::vector<FileSplat> all;
  for (const Splat& splat : splats) all.push_back(file_splat(splat));
  return all;
}

}  // namespace cnerf::bake::test
