#pragma once
/// Baked volumes read piece by piece: what is written to a file grid by grid need not be in memory at once.

#include <functional>
#include <limits>
#include <vector>

#include "bake/baked_volume.h"

namespace cnerf {

/// A baked volume in planes of bricks: plane p holds the voxels with 8 p <= i < 8 p + 8.
struct VolumePlanes : VolumeHeader {
  int begin = 0, end = 0;   ///< planes that may hold voxels
  bool is_sparing = false;  ///< of memory: one thread goes through them
  /// Voxels of any plane, sorted by (i, j, k), no duplicates; none outside [begin, end). Not for several threads, each
  /// of which takes a copy of this struct; cheapest from `begin` upwards.
  std::function<std::vector<BakedVoxel>(int plane)> read;
};

/// A volume in memory, which must outlive the result.  @throws ContractError  when its voxels are not sorted.
[[nodiscard]] VolumePlanes planes_of(const BakedVolume& volume);

/// Several threads go through a volume in parts of consecutive planes: so many of them, no more than threads.
[[nodiscard]] std::size_t part_count(int planes, bool is_sparing);
[[nodiscard]] inline std::size_t part_count(const VolumePlanes& volume) {
  return part_count(volume.end - volume.begin, volume.is_sparing);
}
/// Calls `visit(part, voxels)` for every plane; for those of a part in order, for parts at the same time.
void visit_parts(const VolumePlanes& volume,
                 const std::function<void(std::size_t part, const std::vector<BakedVoxel>& voxels)>& visit);

/// All planes, in memory.
[[nodiscard]] BakedVolume whole_volume(const VolumePlanes& volume);

/// First voxel and extent of the box around all voxels; extent 0 when there are none.
struct VoxelBox {
  Vec3i min{}, size{};
};
[[nodiscard]] VoxelBox bounding_box(const std::vector<BakedVoxel>& voxels);

/// What writers have to know before they see the first voxel.
struct VolumeStatistics {
  VoxelBox all, dense;     ///< around all voxels and around those with density
  std::size_t voxels = 0;  ///< with density
  float min_sigma = std::numeric_limits<float>::infinity(), max_sigma = 0;  ///< 1/world unit; of those
};
/// @throws ContractError  on NaN, infinity or a negative density.
[[nodiscard]] VolumeStatistics statistics_of(const VolumePlanes& volume);

}  // namespace cnerf
