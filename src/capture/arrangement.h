#pragma once
/// How the cameras of a capture stand to its scene. The one place that decides whether a capture is forward-facing.

#include <optional>
#include <vector>

#include "src/capture/capture.h"

namespace cnerf {

struct WorldRay {
  Vec3d origin, direction;  ///< unit length
};

/// The point nearest to all rays in the least-squares sense; nothing where they are too parallel to meet.
/// @param least_spread  determinant of the mean of I - d d^T that counts as meeting: 0 for parallel rays, (2/3)^3 for
///                      rays from everywhere
[[nodiscard]] std::optional<Vec3d> nearest_point(const std::vector<WorldRay>& rays, double least_spread);

struct CameraArrangement {
  bool outward_looking = false;  ///< most look away from where their axes meet: from within, not at something
  bool forward_facing = false;  ///< every optical axis is within 30 degrees of their mean: before the scene, not around
  Vec3d eye;                    ///< the cameras' mean position
  Vec3d forward;                ///< the mean of the optical axes, unit length
  Vec3d up;                     ///< the mean of the pictures' tops, unit length
  Vec3d meeting_point;          ///< nearest to the optical axes; a step ahead of the eye where they are parallel
  Vec3d focus;  ///< what the cameras look at: where the axes meet, or the typical depth of what is before them
};

/// World space.  @param views  at least one
[[nodiscard]] CameraArrangement arrangement_of(const std::vector<View>& views, const std::vector<Vec3d>& points = {},
                                               const std::optional<DepthRange>& depth_range = {});
[[nodiscard]] inline CameraArrangement arrangement_of(const Capture& capture) {
  return arrangement_of(capture.views, positions_of(capture.points), capture.depth_range);
}

/// The views' mean distance from a point.
[[nodiscard]] double mean_distance(const std::vector<View>& views, Vec3d point);

}  // namespace cnerf
