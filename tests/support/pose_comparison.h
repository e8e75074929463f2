#pragma once
/// How far two sets of poses of the same cameras are apart, once the similarity between them is taken out.

#include <cmath>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "src/base/aabb.h"
#include "src/base/check.h"
#include "src/base/error.h"
#include "src/prepare/similarity.h"

namespace cnerf::test {

inline Mat3d mat3(const cv::Matx33d& m) {
  Mat3d out;
  for (int i = 0; i < 3; ++i) out.rows[i] = {m(i, 0), m(i, 1), m(i, 2)};
  return out;
}

inline Vec3d mean_of(std::span<const Vec3d> points) {
  Vec3d sum{};
  for (const Vec3d& point : points) sum += point;
  return sum / double(points.size());
}

/// Angle of a rotation, radians, in [0, pi].
inline double rotation_angle(const Mat3d& r) {
  const Vec3d axis = {r.rows[2].y - r.rows[1].z, r.rows[0].z - r.rows[2].x, r.rows[1].x - r.rows[0].y};
  const double trace = r.rows[0].x + r.rows[1].y + r.rows[2].z;
  return std::atan2(0.5 * length(axis), 0.5 * (trace - 1));  // exact for small angles, unlike acos
}

/// The similarity with the least squared distance of `target[i]` from the image of `source[i]` (Umeyama 1991).
/// @param source, target  the same number of points, at least 3, not all on one line.
/// @throws ContractError  on sizes.  @throws InputError  when the points determine no similarity.
inline prepare::Similarity fit_similarity(std::span<const Vec3d> source, std::span<const Vec3d> target) {
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
  prepare::Similarity out;
  out.rotation = mat3(u * sign * vt);
  out.scale = (singular(0) + singular(1) + handed * singular(2)) / variance;
  out.translation = target_mean - out.scale * (out.rotation * source_mean);
  return out;
}

struct PoseComparison {
  prepare::Similarity truth_from_poses;
  std::vector<double> rotation_degrees;  ///< by view
  std::vector<double> centre_errors;     ///< by view, over the diagonal of the true centres' bounding box
};
/// @param poses, truth  the same cameras in the same order, at least 3 of them, centres not on one line.
inline PoseComparison compare_poses(std::span<const Affined> poses, std::span<const Affined> truth) {
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

}  // namespace cnerf::test
