#pragma once
/// What the program that reads VDB files (vdb_reader_main.cpp) says on its standard output: a header, then as many
/// bytes as it states. Neither side believes the file, and the one that asked does not believe the one that read.

#include <cstdint>
#include <limits>

#include "bake/volume.h"

namespace cnerf::exporting {

/// What a file may hold, or it is refused; docs/export.md states them.
inline constexpr std::uint64_t kMostVoxels = std::uint64_t(1) << 28;  ///< active ones of a grid
inline constexpr std::uint64_t kMostTileVoxels = std::uint64_t(1)
                                                 << 22;     ///< of these, in tiles: a few bytes are many voxels
inline constexpr double kMostBoxVoxels = 68'719'476'736.0;  ///< 4096^3, of the box around them
inline constexpr std::int64_t kLargestIndex = 1 << 24;      ///< of a voxel, either sign
inline constexpr std::uint64_t kLongestText = std::uint64_t(16) << 20;  ///< bytes of a summary or an error
inline constexpr int kMostGrids = 256;

/// Whether a box from `low` to `high`, both inclusive, is one of those that may be.
[[nodiscard]] inline bool is_legal_box(const Vec3i& low, const Vec3i& high) {
  double voxels = 1;
  for (int axis = 0; axis < 3; ++axis) {
    if (low[axis] < -kLargestIndex || high[axis] > kLargestIndex || low[axis] > high[axis]) return false;
    voxels *= double(high[axis]) - low[axis] + 1;
  }
  return voxels <= kMostBoxVoxels;
}

/// In front of an answer.
struct VdbAnswerHeader {
  std::uint32_t version = 1;
  std::int32_t status = 0;  ///< 0, else an ExitCode; the bytes are then its message
  std::uint64_t bytes = 0;
};
/// Of a volume: this, then its voxels, sorted. Of a summary: its record as JSON.
using VdbVolumeHeader = bake::VolumeHeader;

}  // namespace cnerf::exporting
