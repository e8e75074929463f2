#pragma once
/// How full an occupancy grid is, for benchmarks.

#include "src/render/occupancy_grid.h"

namespace cnerf::test {

/// Share of the cells of all cascades that count as occupied.
[[nodiscard]] inline double occupied_share(const OccupancyGrid& grid, const OccupancyLayout& layout) {
  std::size_t occupied = 0, cells = 0;
  for (int cascade = 0; cascade < layout.cascades; ++cascade) {
    for (std::size_t i = 0; i < layout.cells_of_cascade(); ++i, ++cells) {
      occupied += grid.occupied(cascade, layout.point_in(cells, {0.5f, 0.5f, 0.5f})) ? 1 : 0;
    }
  }
  return double(occupied) / double(cells);
}

}  // namespace cnerf::test
