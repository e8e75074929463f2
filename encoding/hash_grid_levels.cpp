#include "encoding/hash_grid_levels.h"

#include <algorithm>
#include <cmath>

namespace cnerf {
namespace {

std::uint32_t cells_of_level(const HashGridOptions& options, int level) {
  if (options.levels == 1) return std::uint32_t(options.coarsest_resolution);
  const double growth =
      std::exp((std::log(double(options.finest_resolution)) - std::log(double(options.coarsest_resolution))) /
               (options.levels - 1));
  // The epsilon keeps N_max itself from being rounded down by the last bit of exp and log.
  return std::uint32_t(std::floor(options.coarsest_resolution * std::pow(growth, level) + 1e-6));
}

}  // namespace

std::vector<GridLevel> hash_grid_levels(const HashGridOptions& options) {
  std::vector<GridLevel> levels;
  std::uint32_t next_row = 0;
  const std::uint64_t most_rows = std::uint64_t(1) << options.log2_rows;
  for (int l = 0; l < options.levels; ++l) {
    GridLevel level;
    level.cells = cells_of_level(options, l);
    const std::uint64_t points = std::uint64_t(level.cells) + 1;
    const std::uint64_t dense_rows = (points * points * points + 7) / 8 * 8;
    level.hashed = dense_rows > most_rows;
    level.rows = std::uint32_t(std::min(dense_rows, most_rows));
    level.first_row = next_row;
    next_row += level.rows;
    levels.push_back(level);
  }
  return levels;
}

std::uint32_t total_rows(const std::vector<GridLevel>& levels) {
  return levels.empty() ? 0 : levels.back().first_row + levels.back().rows;
}

}  // namespace cnerf
