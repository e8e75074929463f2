#include "src/prepare/similarity.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "src/base/aabb.h"
#include "src/base/check.h"
#include "src/base/error.h"

namespace cnerf {
namespace {

cv::Matx33d matx(const Mat3d& m) {
  cv::Matx33d out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out(i, j) = m.rows[i][j];
  }
  return out;
}

Mat3d mat3(const cv::Matx33d& m) {
  Mat3d out;
  for (int i = 0; i < 3; ++i) out.rows[i] = {m(i, 0), m(i, 1), m(i, 2)};
  return out;
}

Vec3d mean_of(std::span<const Vec3d> points) {
  Vec3d sum{};
  for (const Vec3d& point : points) sum += point;
  return sum / double(points.size());
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

double rotation_angle(const Mat3d& r) {
  const Vec3d axis = {r.rows[2].y - r.rows[1].z, r.rows[0].z - r.rows[2].x, r.rows[1].x - r.rows[0].y};
  const double trace = r.rows[0].x + r.rows[1].y + r.rows[2].z;
  return std::atan2(0.5 * length(axis), 0.5 * (trace - 1));  // exact for small angles, unlike acos
}

Similarity fit_similarity(std::span<const Vec3d> source, std::span<const Vec3d> target) {
  CNERF_CHECK_EQ(source.size(), target.size());
  CNERF_CHECK(source.size() >= 3, "a similarity takes three points");
  const Vec3d source_mean = mean_of(source), target_mean = mean_of(target);
  cv::Matx33d covariance = cv::Matx33d::zeros();
  double variance = 0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Vec3d s = source[i] - source_mean, t = target[i] - target_mean;
    variance += dot(s, s);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) covariance(r, c) += t[r] * s[c];
    }
  }
  cv::Matx31d singular;
  cv::Matx33d u, vt;
  cv::SVD::compute(covariance, singular, u, vt);
  if (!(singular(1) > 1e-12 * singular(0)) || !(variance > 0)) {
    throw InputError("a similarity is not determined: the points lie on one line");
  }
  // A reflection would fit better where the determinants differ: the weakest direction is turned round instead.
  const double handed = cv::determinant(u) * cv::determinant(vt) < 0 ? -1 : 1;
  const cv::Matx33d sign(1, 0, 0, 0, 1, 0, 0, 0, handed);
  Similarity out;
  out.rotation = mat3(u * sign * vt);
  out.scale = (singular(0) + singular(1) + handed * singular(2)) / variance;
  out.translation = target_mean - out.scale * (out.rotation * source_mean);
  return out;
}

PoseComparison compare_poses(std::span<const Affined> poses, std::span<const Affined> truth) {
  CNERF_CHECK_EQ(poses.size(), truth.size());
  std::vector<Vec3d> centres, true_centres;
  Aabbd box = Aabbd::empty();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    centres.push_back(poses[i].translation);
    true_centres.push_back(truth[i].translation);
    box.grow(truth[i].translation);
  }
  PoseComparison out;
  out.truth_from_poses = fit_similarity(centres, true_centres);
  const double size = length(box.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Affined aligned = out.truth_from_poses.pose(poses[i]);
    out.centre_errors.push_back(length(aligned.translation - truth[i].translation) / size);
    const Mat3d difference = aligned.linear.transposed() * truth[i].linear;
    out.rotation_degrees.push_back(rotation_angle(difference) * 180 / CV_PI);
  }
  return out;
}

}  // namespace cnerf
