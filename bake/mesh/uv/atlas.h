#pragma once
/// Packs charts into one square texture.

#include <vector>

#include "bake/mesh/uv/uv_charts.h"

namespace cnerf::bake {

/// Where a chart went: its points are turned, scaled by the atlas's scale and moved. Texel (0, 0) is the upper left
/// one, its centre at (0.5, 0.5).
struct ChartPlacement {
  Point2 axis{1, 0};  ///< direction of the chart's x axis, before y is turned downwards
  Point2 offset;      ///< texels
};

struct Atlas {
  float texels_per_unit = 0;  ///< one scale for all charts
  std::vector<ChartPlacement> placements;

  [[nodiscard]] Point2 texel(const ChartPlacement& placement, Point2 p) const {
    const Point2 turned{placement.axis.x * p.x - placement.axis.y * p.y,
                        placement.axis.y * p.x + placement.axis.x * p.y};
    return {placement.offset.x + turned.x * texels_per_unit, placement.offset.y - turned.y * texels_per_unit};
  }
};

/// The largest scale at which all charts go into `size` x `size` texels with `gutter` texels around each that belong to
/// no other, found by bisection. Every chart is turned to its smallest box and hung from the skyline of those before
/// it, as high as it goes and with small gaps; its own outline counts, not its box.
/// @param charts  triangles of each chart, in its plane.
/// @throws UsageError  when not even their gutters fit.
[[nodiscard]] Atlas pack_charts(const std::vector<std::vector<PlanarTriangle>>& charts, int size, int gutter);

}  // namespace cnerf::bake
