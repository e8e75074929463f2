#include "bake/volume_planes.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "bake/brick_grid.h"
#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

constexpr int kPlanesOfPart = 4;  ///< at least: neighbours are read by both of two parts

/// Grows with every voxel it is told of.
class GrowingBox {
 public:
  void add(const BakedVoxel& voxel) {
    const Vec3i at{voxel.i, voxel.j, voxel.k};
    for (int axis = 0; axis < 3; ++axis) {
      low_[axis] = std::min(low_[axis], at[axis]);
      high_[axis] = std::max(high_[axis], at[axis]);
    }
  }
  void add(const GrowingBox& other) {
    for (int axis = 0; axis < 3; ++axis) {
      low_[axis] = std::min(low_[axis], other.low_[axis]);
      high_[axis] = std::max(high_[axis], other.high_[axis]);
    }
  }
  [[nodiscard]] VoxelBox box() const {
    if (low_.x > high_.x) return {};
    return {low_, high_ - low_ + Vec3i{1, 1, 1}};
  }

 private:
  static constexpr int kMost = std::numeric_limits<int>::max();
  Vec3i low_{kMost, kMost, kMost}, high_{-kMost, -kMost, -kMost};
};

void check_voxel(const BakedVoxel& v) {
  const bool finite = std::isfinite(v.sigma) && std::isfinite(v.luminance) && std::isfinite(v.rgb.x) &&
                      std::isfinite(v.rgb.y) && std::isfinite(v.rgb.z) && std::isfinite(v.a) && std::isfinite(v.b);
  CNERF_CHECK(finite && v.sigma >= 0, "voxel with NaN, infinity or negative density at " + std::to_string(v.i) + ", " +
                                          std::to_string(v.j) + ", " + std::to_string(v.k));
}

int plane_of(int i) {
  static_assert(kBrickSide == 8);
  return i >> 3;  // downwards, also for negative ones
}

}  // namespace

VolumePlanes planes_of(const BakedVolume& volume) {
  const std::vector<BakedVoxel>& voxels = volume.voxels;
  CNERF_CHECK(std::is_sorted(voxels.begin(), voxels.end(),
                             [](const BakedVoxel& a, const BakedVoxel& b) {
                               return std::tie(a.i, a.j, a.k) < std::tie(b.i, b.j, b.k);
                             }),
              "voxels must be sorted by (i, j, k)");
  VolumePlanes planes{volume, 0, 0, false, {}};
  if (!voxels.empty()) {
    planes.begin = plane_of(voxels.front().i);
    planes.end = plane_of(voxels.back().i) + 1;
  }
  planes.read = [&voxels](int plane) {
    const auto before = [](const BakedVoxel& voxel, int i) { return voxel.i < i; };
    const auto begin = std::lower_bound(voxels.begin(), voxels.end(), kBrickSide * plane, before);
    const auto end = std::lower_bound(begin, voxels.end(), kBrickSide * (plane + 1), before);
    return std::vector<BakedVoxel>(begin, end);
  };
  return planes;
}

std::size_t part_count(int planes, bool is_sparing) {
  if (is_sparing) return planes > 0 ? 1 : 0;
  return std::size_t(std::clamp(planes / kPlanesOfPart, std::min(planes, 1), thread_count()));
}

void visit_parts(const VolumePlanes& volume,
                 const std::function<void(std::size_t, const std::vector<BakedVoxel>&)>& visit) {
  const int planes = volume.end - volume.begin;
  const auto parts = int(part_count(volume));
  parallel_tasks(std::size_t(parts), [&](std::size_t part) {
    const VolumePlanes own = volume;
    const auto number = int(part);
    const int begin = volume.begin + planes * number / parts, end = volume.begin + planes * (number + 1) / parts;
    for (int plane = begin; plane < end; ++plane) visit(part, own.read(plane));
  });
}

BakedVolume whole_volume(const VolumePlanes& volume) {
  BakedVolume whole{volume, {}};
  for (int plane = volume.begin; plane < volume.end; ++plane) {
    const std::vector<BakedVoxel> voxels = volume.read(plane);
    whole.voxels.insert(whole.voxels.end(), voxels.begin(), voxels.end());
  }
  return whole;
}

VoxelBox bounding_box(const std::vector<BakedVoxel>& voxels) {
  GrowingBox box;
  for (const BakedVoxel& voxel : voxels) box.add(voxel);
  return box.box();
}

VolumeStatistics statistics_of(const VolumePlanes& volume) {
  struct Part {
    GrowingBox all, dense;
    VolumeStatistics numbers;
  };
  std::vector<Part> parts(part_count(volume));
  visit_parts(volume, [&](std::size_t part, const std::vector<BakedVoxel>& voxels) {
    auto& [all, dense, numbers] = parts[part];
    for (const BakedVoxel& voxel : voxels) {
      check_voxel(voxel);
      all.add(voxel);
      if (!(voxel.sigma > 0)) continue;
      dense.add(voxel);
      ++numbers.voxels;
      numbers.min_sigma = std::min(numbers.min_sigma, voxel.sigma);
      numbers.max_sigma = std::max(numbers.max_sigma, voxel.sigma);
    }
  });
  Part sum;
  for (const auto& [all, dense, numbers] : parts) {
    sum.all.add(all);
    sum.dense.add(dense);
    sum.numbers.voxels += numbers.voxels;
    sum.numbers.min_sigma = std::min(sum.numbers.min_sigma, numbers.min_sigma);
    sum.numbers.max_sigma = std::max(sum.numbers.max_sigma, numbers.max_sigma);
  }
  sum.numbers.all = sum.all.box();
  sum.numbers.dense = sum.dense.box();
  return sum.numbers;
}

}  // namespace cnerf
