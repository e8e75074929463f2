#pragma once
/// Similarities: rotation, uniform scale, translation. What structure from motion leaves open, and how two sets of
/// poses of the same cameras are compared.

#include <span>
#include <vector>

#include "src/base/vec3.h"

namespace cnerf {

/// `target = scale * rotation * source + translation`.
struct Similarity {
  double scale = 1;
  Mat3d rotation = Mat3d::identity();
  Vec3d translation{};

  [[nodiscard]] Vec3d point(Vec3d p) const { return scale * (rotation * p) + translation; }
  /// A rigid pose `source_from_x` as `target_from_x`: the centre moves, the axes turn and stay of unit length.
  [[nodiscard]] Affined pose(const Affined& source_from_x) const {
    return {rotation * source_from_x.linear, point(source_from_x.translation)};
  }
  [[nodiscard]] Similarity inverse() const;
};
/// `first`, then `second`.
[[nodiscard]] Similarity operator*(const Similarity& second, const Similarity& first);

/// Eigenvectors of a symmetric matrix by ascending eigenvalue, as columns of a rotation.
struct SymmetricEigen {
  Vec3d values;
  Mat3d vectors;
};
[[nodiscard]] SymmetricEigen symmetric_eigen(const Mat3d& matrix);

/// The rotation that turns unit vector `from` into unit vector `to` along the shortest way; half a turn about any
/// perpendicular axis where they are opposite.
[[nodiscard]] Mat3d rotation_between(Vec3d from, Vec3d to);

/// Angle of a rotation, radians, in [0, pi].
[[nodiscard]] double rotation_angle(const Mat3d& rotation);

/// The similarity with the least squared distance of `target[i]` from the image of `source[i]` (Umeyama 1991).
/// @param source, target  the same number of points, at least 3, not all on one line.
/// @throws ContractError  on sizes.  @throws InputError  when the points determine no similarity.
[[nodiscard]] Similarity fit_similarity(std::span<const Vec3d> source, std::span<const Vec3d> target);

/// How far poses are from the true ones once a similarity between the camera centres is taken out.
struct PoseComparison {
  Similarity truth_from_poses;
  std::vector<double> rotation_degrees;  ///< by view
  std::vector<double> centre_errors;     ///< by view, over the diagonal of the true centres' bounding box
};
/// @param poses, truth  the same cameras in the same order, at least 3 of them, centres not on one line.
[[nodiscard]] PoseComparison compare_poses(std::span<const Affined> poses, std::span<const Affined> truth);

}  // namespace cnerf
