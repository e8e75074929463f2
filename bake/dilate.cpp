#include "bake/dilate.h"

#include <algorithm>
#include <optional>
#include <tuple>

#include "bake/brick_grid.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

// What the index grid says of a place: the index of a voxel with density, or one of these.
constexpr std::int32_t kMissing = -1;
constexpr std::int32_t kColorOnly = -2;

/// Squared distance from density, in voxels, at which trilinear interpolation no longer mixes in a voxel's colour.
constexpr int kBeyondInterpolation = 4;

using IndexGrid = BrickGrid<std::int32_t>;

IndexGrid index_voxels(const BakedVolume& volume, int radius) {
  const VoxelBox box = bounding_box(volume.voxels);
  Vec3i low = box.min - Vec3i{radius, radius, radius};
  const Vec3i high = box.min + box.size + Vec3i{radius, radius, radius};
  for (int axis = 0; axis < 3; ++axis) low[axis] &= ~(kBrickSide - 1);  // bricks are the leaves of a VDB
  IndexGrid grid(low, high - low, kMissing);
  for (std::size_t v = 0; v < volume.voxels.size(); ++v) {
    const BakedVoxel& voxel = volume.voxels[v];
    const Vec3i at{voxel.i, voxel.j, voxel.k};
    CNERF_CHECK(grid.at(at) == kMissing, "two baked voxels share a place");
    grid.set(at, voxel.sigma > 0 ? static_cast<std::int32_t>(v) : kColorOnly);
  }
  return grid;
}

/// All offsets of the cube of this radius, nearest first.
std::vector<Vec3i> offsets_by_distance(int radius) {
  std::vector<Vec3i> offsets;
  for (int x = -radius; x <= radius; ++x)
    for (int y = -radius; y <= radius; ++y)
      for (int z = -radius; z <= radius; ++z) offsets.push_back({x, y, z});
  std::stable_sort(offsets.begin(), offsets.end(), [](Vec3i a, Vec3i b) { return dot(a, a) < dot(b, b); });
  return offsets;
}

/// Which voxels of a brick have density within `radius`: a box dilation, one axis after the other.
class NearDensity {
 public:
  NearDensity(const IndexGrid& grid, Vec3i brick_min, int radius)
      : radius_(radius), side_(kBrickSide + 2 * radius), near_(static_cast<std::size_t>(side_) * side_ * side_) {
    for (std::size_t i = 0; i < near_.size(); ++i) {
      near_[i] = grid.at(brick_min + position(i) - Vec3i{radius, radius, radius}) >= 0;
    }
    for (int axis = 0; axis < 3; ++axis) dilate(axis);
  }
  [[nodiscard]] bool operator()(Vec3i local) const { return near_[index(local + Vec3i{radius_, radius_, radius_})]; }

 private:
  [[nodiscard]] std::size_t index(Vec3i p) const { return (static_cast<std::size_t>(p.x) * side_ + p.y) * side_ + p.z; }
  [[nodiscard]] Vec3i position(std::size_t i) const {
    const auto n = static_cast<int>(i);
    return {n / (side_ * side_), n / side_ % side_, n % side_};
  }
  void dilate(int axis) {
    const std::vector<char> before = near_;
    for (std::size_t i = 0; i < near_.size(); ++i) {
      Vec3i p = position(i);
      const int centre = p[axis];
      for (int at = std::max(0, centre - radius_); at <= std::min(side_ - 1, centre + radius_); ++at) {
        p[axis] = at;
        near_[i] |= before[index(p)];
      }
    }
  }

  int radius_, side_;
  std::vector<char> near_;
};

std::vector<BakedVoxel> missing_voxels(const IndexGrid& grid, std::size_t brick, const std::vector<BakedVoxel>& voxels,
                                       int radius, const std::vector<Vec3i>& offsets) {
  const Vec3i brick_min = grid.brick_min(brick);
  const NearDensity near_density(grid, brick_min, radius);
  std::vector<BakedVoxel> added;
  std::optional<BakedVoxel> outer;
  for (int offset = 0; offset < kBrickVoxels; ++offset) {
    const Vec3i local = brick_local(offset);
    const Vec3i at = brick_min + local;
    if (!near_density(local) || grid.at(at) != kMissing) continue;
    const auto source = std::find_if(offsets.begin(), offsets.end(), [&](Vec3i o) { return grid.at(at + o) >= 0; });
    BakedVoxel voxel = voxels[grid.at(at + *source)];
    if (dot(*source, *source) >= kBeyondInterpolation) {
      if (!outer) outer = voxel;
      voxel = *outer;
    }
    voxel.i = at.x;
    voxel.j = at.y;
    voxel.k = at.z;
    voxel.sigma = 0;
    added.push_back(voxel);
  }
  return added;
}

}  // namespace

void sort_voxels(std::vector<BakedVoxel>& voxels) {
  std::sort(voxels.begin(), voxels.end(),
            [](const BakedVoxel& a, const BakedVoxel& b) { return std::tie(a.i, a.j, a.k) < std::tie(b.i, b.j, b.k); });
}

VoxelBox bounding_box(const std::vector<BakedVoxel>& voxels) {
  if (voxels.empty()) return {};
  Vec3i low{voxels[0].i, voxels[0].j, voxels[0].k};
  Vec3i high = low;
  for (const BakedVoxel& voxel : voxels) {
    const Vec3i at{voxel.i, voxel.j, voxel.k};
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], at[axis]);
      high[axis] = std::max(high[axis], at[axis]);
    }
  }
  return {low, high - low + Vec3i{1, 1, 1}};
}

void dilate_colors(BakedVolume& volume, int radius) {
  CNERF_CHECK(radius >= 0 && radius <= kBrickSide, "dilation must be within [0, 8] voxels");
  if (volume.voxels.empty()) return;
  const IndexGrid grid = index_voxels(volume, radius);
  const std::vector<Vec3i> offsets = offsets_by_distance(radius);
  const std::vector<char> touched = bricks_with_neighbours(grid);
  std::vector<std::vector<BakedVoxel>> added(grid.brick_count());
  parallel_tasks(grid.brick_count(), [&](std::size_t brick) {
    if (touched[brick]) added[brick] = missing_voxels(grid, brick, volume.voxels, radius, offsets);
  });
  for (const std::vector<BakedVoxel>& brick : added) {
    volume.voxels.insert(volume.voxels.end(), brick.begin(), brick.end());
  }
  sort_voxels(volume.voxels);
}

}  // namespace cnerf
