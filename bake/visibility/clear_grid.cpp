#include "bake/visibility/clear_grid.h"

namespace cnerf::bake {
namespace {

constexpr int kFarthest = 255;  // a brick, 0 where there is one

/// Chessboard distances, of which one pass finds those to bricks before (`way` = 1) or behind (-1) each brick in order
/// (Rosenfeld and Pfaltz 1968).
void pass(const BrickGrid<float>& grid, int way, std::vector<std::uint8_t>& distance) {
  const Vec3i counts = grid.brick_counts();
  const std::size_t n = distance.size();
  for (std::size_t turn = 0; turn < n; ++turn) {
    const std::size_t b = way > 0 ? turn : n - 1 - turn;
    const Vec3i c = grid.brick_coordinates(b);
    int nearest = distance[b];
    for (int i = 0; i < 13; ++i) {  // of the 27 around it, those that the pass has been to
      const Vec3i other = {c.x + way * (i / 9 - 1), c.y + way * (i / 3 % 3 - 1), c.z + way * (i % 3 - 1)};
      if (other.x < 0 || other.y < 0 || other.z < 0) continue;
      if (other.x >= counts.x || other.y >= counts.y || other.z >= counts.z) continue;
      nearest = std::min(nearest, distance[grid.brick_at(other)] + 1);
    }
    distance[b] = std::uint8_t(nearest);
  }
}

}  // namespace

ClearGrid::ClearGrid(const BrickGrid<float>& grid) : grid_(&grid), clear_(grid.brick_count()) {
  for (std::size_t b = 0; b < clear_.size(); ++b) clear_[b] = grid.has_brick(b) ? 0 : kFarthest;
  pass(grid, 1, clear_);
  pass(grid, -1, clear_);
  for (std::uint8_t& clear : clear_) clear = std::uint8_t(std::max(0, clear - 1));
}

}  // namespace cnerf::bake
