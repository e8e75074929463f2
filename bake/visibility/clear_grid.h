#pragma once
/// Density in bricks, with how far around an empty place there is nothing.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "bake/lattice/brick_grid.h"

namespace cnerf::bake {

/// Chessboard distances of cells, of whose three numbers the last runs fastest: how many cells away, along any axis,
/// the nearest one with 0 is, at most 255.
/// @param distance  [counts] 0, and 255 where it is looked for
void fill_distances(Vec3i counts, std::vector<std::uint8_t>& distance);

/// A BrickGrid<float> as rays read it (see sight_math.h), from which they leave empty space in few steps. The grid must
/// outlive this, and not change.
class ClearGrid {
 public:
  explicit ClearGrid(const BrickGrid<float>& grid);

  [[nodiscard]] Vec3i min() const { return grid_->min(); }
  [[nodiscard]] Vec3i size() const { return grid_->size(); }
  [[nodiscard]] const float* find_brick(Vec3i relative) const { return grid_->find_brick(relative); }
  /// Around a brick that does not exist: how many on all sides do not exist either, at least.
  [[nodiscard]] int clear_bricks(Vec3i relative) const { return clear_[grid_->brick_at(brick_part(relative))]; }

 private:
  const BrickGrid<float>* grid_;
  std::vector<std::uint8_t> clear_;  // [bricks]
};

}  // namespace cnerf::bake
