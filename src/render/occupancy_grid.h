#pragma once
/// Which space is worth sampling: nested grids of bits (cascades) around the middle of the unit cube, as in Mueller et
/// al. 2022, App. E. Cascade k covers the cube of side 2^(k - cascades + 1) around (0.5, 0.5, 0.5).

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "src/base/options.h"
#include "src/base/vec3.h"
#include "src/render/occupancy_math.h"

namespace cnerf {

struct OccupancyOptions {
  int resolution = 128;             ///< cells along a side of a cascade; a multiple of 16
  float decay = 0.5f;               ///< share of a cell's remembered density that is left at each visit
  float optical_thickness = 0.03f;  ///< of a cell, below which it counts as empty
};

class OccupancyGrid {
 public:
  OccupancyGrid(const OccupancyOptions& options, int cascades);

  /// The innermost cascade whose box holds `p`, of [0, 1]^3.
  [[nodiscard]] int cascade_of(Vec3f p) const { return layout_.cascade_of(p); }
  [[nodiscard]] bool occupied(int cascade, Vec3f p) const {
    const std::size_t cell = layout_.cell_of(cascade, p);
    return (bits_[cell / 64] >> (cell % 64)) & 1u;
  }
  /// `occupied` of the innermost cascade that holds them, for all points of a lattice.
  /// @param marks  [x][y][z], written: 1 where it is
  void mark_occupied(std::span<const float> x, std::span<const float> y, std::span<const float> z,
                     std::span<std::uint8_t> marks) const;
  /// False when all 8^3 cells around `p` are empty as well: a marcher may leave the whole block at once.
  [[nodiscard]] bool block_occupied(int cascade, Vec3f p) const { return blocks_[layout_.block_of(cascade, p)] != 0; }

  /// Side of a cell of a cascade, unit space.
  [[nodiscard]] float cell_side(int cascade) const { return layout_.cell_side(cascade); }

  /// Asks `density` for sigma at a point of each cell that the update visits, and refreshes the bits of the whole grid.
  /// The result is a pure function of the arguments and the state.
  void update(const OccupancyUpdate& update,
              const std::function<void(std::span<const Vec3f>, std::span<float>)>& density);

  /// Declares space empty for good where `wanted(centre, radius)`, asked for the sphere around each 4^3 block of cells,
  /// says that nothing there can be seen.
  void exclude(const std::function<bool(Vec3f centre, float radius)>& wanted);

  /// The state to save and restore; call `refresh_bits` after changing it.
  [[nodiscard]] std::vector<float>& densities() { return density_; }
  [[nodiscard]] const std::vector<float>& densities() const { return density_; }
  void refresh_bits();

 private:
  OccupancyOptions options_;
  OccupancyLayout layout_;
  std::vector<float> density_;        ///< [cascades, R, R, R], sigma; x fastest; kExcludedCell where nothing can be
  std::vector<std::uint64_t> bits_;   ///< one bit per cell, same order
  std::vector<std::uint8_t> blocks_;  ///< [cascades, R/8, R/8, R/8], 1 = some cell is occupied
};

}  // namespace cnerf
