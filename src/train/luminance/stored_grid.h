#pragma once
/// What a snapshot says of its hash grids, before memory is taken for them: a header of a few bytes may state anything.

#include <cstdint>
#include <string>

#include "encoding/hash_grid_levels.h"
#include "src/train/luminance/snapshot.h"

namespace cnerf {

/// @throws SnapshotError  for a grid that no option can ask for, or whose table is larger than the file
inline void check_stored_grid(const Snapshot& snapshot, const HashGridOptions& grid) {
  constexpr std::uint64_t kRowBytes = 4 * sizeof(float);
  constexpr int kMostLog2Rows = 24, kMostResolution = 1 << 16;
  const auto refuse = [&](const std::string& what) {
    throw SnapshotError(snapshot.file().string() + ": header: options.grid: " + what);
  };
  const auto require = [&](const char* name, int value, int least, int most) {
    if (value >= least && value <= most) return;
    refuse(std::string(name) + ": expected " + std::to_string(least) + " to " + std::to_string(most) + ", found " +
           std::to_string(value));
  };
  require("levels", grid.levels, 1, kMaxGridLevels);
  require("log2_rows", grid.log2_rows, 3, kMostLog2Rows);
  require("finest_resolution", grid.finest_resolution, 1, kMostResolution);
  require("coarsest_resolution", grid.coarsest_resolution, 1, grid.finest_resolution);
  const std::uint64_t table = total_rows(hash_grid_levels(grid)) * kRowBytes;
  if (table > snapshot.bytes()) {
    refuse("its table is of " + std::to_string(table) + " bytes, the file of " + std::to_string(snapshot.bytes()));
  }
}

}  // namespace cnerf
