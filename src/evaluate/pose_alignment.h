#pragma once
/// The similarity between two sets of poses of the same cameras that are nearly alike, to first order.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "src/base/vec3.h"
#include "src/render/view_correction.h"

namespace cnerf {

struct PoseAlignment {
  Vec3d turn, move, centre;
  double growth = 0;
  double median_degrees = 0;  ///< between the poses, once aligned

  [[nodiscard]] Affined applied_to(const Affined& pose) const {
    const Vec3d arm = pose.translation - centre;
    return {Mat3d::from_columns(turned(turn, pose.linear.column(0)), turned(turn, pose.linear.column(1)),
                                turned(turn, pose.linear.column(2))),
            pose.translation + cross(turn, arm) + growth * arm + move};
  }
};

/// Takes `from` to `to` with the least squares of the centres' distances and of the rotations' angles.
/// @param reach  the distance at which an angle counts as the way it makes, world units
[[nodiscard]] inline PoseAlignment align_poses(std::span<const Affined> from, std::span<const Affined> to,
                                               double reach) {
  PoseAlignment found;
  const auto n = double(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    found.centre += from[i].translation / n;
    found.move += (to[i].translation - from[i].translation) / n;
  }
  Mat3d normal{};
  Vec3d right{};
  double outwards = 0, spread = 0;
  std::vector<Vec3d> turns;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vec3d arm = from[i].translation - found.centre, way = to[i].translation - from[i].translation - found.move;
    turns.push_back(rotation_vector(to[i].linear * from[i].linear.transposed()));
    right += cross(arm, way) + reach * reach * turns.back();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) normal.rows[r][c] += (r == c ? dot(arm, arm) + reach * reach : 0) - arm[r] * arm[c];
    }
    outwards += dot(arm, way);
    spread += dot(arm, arm);
  }
  found.turn = normal.inverse() * right;
  if (spread > 0) found.growth = outwards / spread;
  std::vector<double> left;
  for (const Vec3d& turn : turns) left.push_back(length(turn - found.turn) * 180 / std::numbers::pi);
  std::ranges::sort(left);
  found.median_degrees = left.empty() ? 0 : left[left.size() / 2];
  return found;
}

}  // namespace cnerf
