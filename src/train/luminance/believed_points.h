#pragma once
/// Sparse points that are exact and sure enough to go by.

#include <cstddef>
#include <vector>

#include "src/capture/capture.h"

namespace cnerf {

/// Nearer than two pixels to where its pictures show it, and shown by three of them.
[[nodiscard]] inline bool is_believed(const SparsePoint& point) {
  return point.error <= 2 && point.views.size() >= 3;
}

/// Per view, world space.  @param n_views  the `views` of points are below it
[[nodiscard]] inline std::vector<std::vector<Vec3d>> believed_points(std::size_t n_views,
                                                                     const std::vector<SparsePoint>& points) {
  std::vector<std::vector<Vec3d>> shown(n_views);
  for (const SparsePoint& point : points) {
    if (!is_believed(point)) continue;
    for (const std::uint32_t view : point.views) shown[view].push_back(point.position);
  }
  return shown;
}

}  // namespace cnerf
