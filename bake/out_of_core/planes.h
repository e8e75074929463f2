#pragma once
/// Baked volumes read piece by piece: what is written to a file grid by grid need not be in memory at once.

#include <algorithm>
#include <functional>
#include <limits>
#include <vector>

#include "bake/volume.h"

namespace cnerf::bake {

/// A box of voxels [low, high); holds nothing until voxels are added.
struct VoxelBox {
  static constexpr int kMost = std::numeric_limits<int>::max();
  Vec3i low{kMost, kMost, kMost}, high{-kMost, -kMost, -kMost};

  [[nodiscard]] bool is_empty() const { return low.x >= high.x; }
  [[nodiscard]] Vec3i size() const { return high - low; }
  /// Of a box that is not empty.
  [[nodiscard]] VoxelBox grown(int margin) const {
    const Vec3i m{margin, margin, margin};
    return {low - m, high + m};
  }
  /// Grows so that it holds the other.
  void add(const VoxelBox& other) {
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], other.low[axis]);
      high[axis] = std::max(high[axis], other.high[axis]);
    }
  }
  void add(const Voxel& v) { add({{v.i, v.j, v.k}, {v.i + 1, v.j + 1, v.k + 1}}); }
};
/// Whether all values are finite and density is not negative.
[[nodiscard]] bool is_valid(const Voxel& voxel);
/// Around all voxels.
[[nodiscard]] VoxelBox bounding_box(const std::vector<Voxel>& voxels);

/// What writers have to know before they see the first voxel.
struct VolumeStatistics {
  VoxelBox all, dense;     ///< around all voxels and around those with density
  std::size_t voxels = 0;  ///< with density
  float min_sigma = std::numeric_limits<float>::infinity(), max_sigma = 0;  ///< 1/world unit; of those

  /// @throws ContractError  on NaN, infinity or a negative density.
  void add(const std::vector<Voxel>& more);
};

/// A baked volume in planes of bricks: plane p holds the voxels with 8 p <= i < 8 p + 8.
struct VolumePlanes : VolumeHeader {
  VolumeStatistics statistics;
  int begin = 0, end = 0;   ///< planes that may hold voxels
  bool is_sparing = false;  ///< of memory: one thread goes through them
  /// Voxels of any plane, sorted by (i, j, k), no duplicates; none outside [begin, end). Not for several threads, each
  /// of which takes a copy of this struct; cheapest from `begin` upwards.
  std::function<std::vector<Voxel>(int plane)> read;
};

/// A volume in memory, which must outlive the result.
/// @throws ContractError  when its voxels are not sorted, and as VolumeStatistics::add.
[[nodiscard]] VolumePlanes planes_of(const Volume& volume);

/// Several threads go through a volume in parts of consecutive planes: so many of them, no more than threads.
[[nodiscard]] std::size_t part_count(int planes, bool is_sparing);
[[nodiscard]] inline std::size_t part_count(const VolumePlanes& volume) {
  return part_count(volume.end - volume.begin, volume.is_sparing);
}
/// Calls `visit(part, voxels)` for every plane; for those of a part in order, for parts at the same time.
void visit_parts(const VolumePlanes& volume,
                 const std::function<void(std::size_t part, const std::vector<Voxel>& voxels)>& visit);

/// All planes, in memory.
[[nodiscard]] Volume whole_volume(const VolumePlanes& volume);

}  // namespace cnerf::bake
