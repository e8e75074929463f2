#include "src/prepare/similarity.h"

#include <cmath>
#include <opencv2/core.hpp>

namespace cnerf::prepare {
namespace {

cv::Matx33d matx(const Mat3d& m) {
  cv::Matx33d out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out(i, j) = m.rows[i][j];
  }
  return out;
}

}  // namespace

Similarity Similarity::inverse() const {
  const Mat3d back = rotation.transposed();
  return {1 / scale, back, -(back * translation) / scale};
}

Similarity operator*(const Similarity& second, const Similarity& first) {
  return {second.scale * first.scale, second.rotation * first.rotation, second.point(first.translation)};
}

SymmetricEigen symmetric_eigen(const Mat3d& matrix) {
  cv::Matx31d values;
  cv::Matx33d rows;  // eigenvectors, by descending eigenvalue
  cv::eigen(matx(matrix), values, rows);
  SymmetricEigen out;
  out.values = {values(2), values(1), values(0)};
  const Vec3d a = {rows(2, 0), rows(2, 1), rows(2, 2)}, b = {rows(1, 0), rows(1, 1), rows(1, 2)};
  out.vectors = Mat3d::from_columns(a, b, cross(a, b));
  return out;
}

Mat3d rotation_between(Vec3d from, Vec3d to) {
  const double cosine = dot(from, to);
  if (cosine < -1 + 1e-12) {
    const Vec3d other = std::abs(from.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
    const Vec3d axis = normalized(cross(from, other));
    Mat3d half_turn = Mat3d::identity() * -1.0;  // 2 a a^T - I
    for (int i = 0; i < 3; ++i) half_turn.rows[i] += axis * (2 * axis[i]);
    return half_turn;
  }
  const Vec3d v = cross(from, to);
  const Mat3d skew = {{{0, -v.z, v.y}, {v.z, 0, -v.x}, {-v.y, v.x, 0}}};
  const Mat3d square = skew * skew * (1 / (1 + cosine));
  Mat3d out = Mat3d::identity();
  for (int i = 0; i < 3; ++i) out.rows[i] += skew.rows[i] + square.rows[i];
  return out;
}

}  // namespace cnerf::prepare
