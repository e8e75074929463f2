#include "bake/visibility/clear_grid.h"

#include <cstddef>

namespace cnerf::bake {
namespace {

constexpr int kFarthest = 255;  // a brick, 0 where there is one

/// One pass finds distances to cells before (`way` = 1) or behind (-1) each cell in order (Rosenfeld and Pfaltz 1968).
void pass(Vec3i counts, int way, std::vector<std::uint8_t>& distance) {
  const auto number = [&](Vec3i c) { return (std::size_t(c.x) * counts.y + c.y) * counts.z + c.z; };
  const std::size_t n = distance.size();
  for (std::size_t turn = 0; turn < n; ++turn) {
    const std::size_t cell = way > 0 ? turn : n - 1 - turn;
    const auto at = std::ptrdiff_t(cell);
    const Vec3i c{int(at / counts.z / counts.y), int(at / counts.z % counts.y), int(at % counts.z)};
    int nearest = distance[cell];
    for (int i = 0; i < 13; ++i) {  // of the 27 around it, those that the pass has been to
      const Vec3i other = {c.x + way * (i / 9 - 1), c.y + way * (i / 3 % 3 - 1), c.z + way * (i % 3 - 1)};
      if (other.x < 0 || other.y < 0 || other.z < 0) continue;
      if (other.x >= counts.x || other.y >= counts.y || other.z >= counts.z) continue;
      nearest = std::min(nearest, distance[number(other)] + 1);
    }
    distance[cell] = std::uint8_t(nearest);
  }
}

}  // namespace

void fill_distances(Vec3i counts, std::vector<std::uint8_t>& distance) {
  pass(counts, 1, distance);
  pass(counts, -1, distance);
}

ClearGrid::ClearGrid(const BrickGrid<float>& grid) : grid_(&grid), clear_(grid.brick_count()) {
  for (std::size_t b = 0; b < clear_.size(); ++b) clear_[b] = grid.has_brick(b) ? 0 : kFarthest;
  fill_distances(grid.brick_counts(), clear_);
  for (std::uint8_t& clear : clear_) clear = std::uint8_t(std::max(0, clear - 1));
}

}  // namespace cnerf::bake
