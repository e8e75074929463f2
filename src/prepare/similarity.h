#pragma once
/// Similarities: rotation, uniform scale, translation. What structure from motion leaves open.

#include "src/base/vec3.h"

namespace cnerf::prepare {

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

}  // namespace cnerf::prepare
