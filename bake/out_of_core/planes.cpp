#include "bake/out_of_core/planes.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "bake/lattice/brick_grid.h"
#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr int kPlanesOfPart = 4;  ///< at least: neighbours are read by both of two parts

void check_voxel(const Voxel& v) {
  CNERF_CHECK(is_valid(v), "voxel with NaN, infinity or negative density at " + std::to_string(v.i) + ", " +
                               std::to_string(v.j) + ", " + std::to_string(v.k));
}

int plane_of(int i) {
  static_assert(kBrickSide == 8);
  return i >> 3;  // downwards, also for negative ones
}

}  // namespace

bool is_valid(const Voxel& v) {
  const bool finite = std::isfinite(v.sigma) && std::isfinite(v.luminance) && std::isfinite(v.rgb.x) &&
                      std::isfinite(v.rgb.y) && std::isfinite(v.rgb.z) && std::isfinite(v.a) && std::isfinite(v.b);
  return finite && v.sigma >= 0;
}

void VolumeStatistics::add(const std::vector<Voxel>& more) {
  for (const Voxel& voxel : more) {
    check_voxel(voxel);
    all.add(voxel);
    if (!(voxel.sigma > 0)) continue;
    dense.add(voxel);
    ++voxels;
    min_sigma = std::min(min_sigma, voxel.sigma);
    max_sigma = std::max(max_sigma, voxel.sigma);
  }
}

VolumePlanes planes_of(const Volume& volume) {
  const std::vector<Voxel>& voxels = volume.voxels;
  CNERF_CHECK(
      std::is_sorted(voxels.begin(), voxels.end(),
                     [](const Voxel& a, const Voxel& b) { return std::tie(a.i, a.j, a.k) < std::tie(b.i, b.j, b.k); }),
      "voxels must be sorted by (i, j, k)");
  VolumePlanes planes{static_cast<const VolumeHeader&>(volume), {}, 0, 0, false, {}};
  planes.statistics.add(voxels);
  if (!voxels.empty()) {
    planes.begin = plane_of(voxels.front().i);
    planes.end = plane_of(voxels.back().i) + 1;
  }
  planes.read = [&voxels](int plane) {
    const auto before = [](const Voxel& voxel, int i) { return voxel.i < i; };
    const auto begin = std::lower_bound(voxels.begin(), voxels.end(), kBrickSide * plane, before);
    const auto end = std::lower_bound(begin, voxels.end(), kBrickSide * (plane + 1), before);
    return std::vector<Voxel>(begin, end);
  };
  return planes;
}

std::size_t part_count(int planes, bool is_sparing) {
  if (is_sparing) return planes > 0 ? 1 : 0;
  return std::size_t(std::clamp(planes / kPlanesOfPart, std::min(planes, 1), thread_count()));
}

void visit_parts(const VolumePlanes& volume, const std::function<void(std::size_t, const std::vector<Voxel>&)>& visit) {
  const int planes = volume.end - volume.begin;
  const auto parts = int(part_count(volume));
  parallel_tasks(std::size_t(parts), [&](std::size_t part) {
    const VolumePlanes own = volume;
    const auto number = int(part);
    const int begin = volume.begin + planes * number / parts, end = volume.begin + planes * (number + 1) / parts;
    for (int plane = begin; plane < end; ++plane) visit(part, own.read(plane));
  });
}

Volume whole_volume(const VolumePlanes& volume) {
  Volume whole{static_cast<const VolumeHeader&>(volume), {}};
  for (int plane = volume.begin; plane < volume.end; ++plane) {
    const std::vector<Voxel> voxels = volume.read(plane);
    whole.voxels.insert(whole.voxels.end(), voxels.begin(), voxels.end());
  }
  return whole;
}

VoxelBox bounding_box(const std::vector<Voxel>& voxels) {
  VoxelBox box;
  for (const Voxel& voxel : voxels) box.add(voxel);
  return box;
}

}  // namespace cnerf::bake
