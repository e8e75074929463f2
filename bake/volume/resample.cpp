#include "bake/volume/resample.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include "bake/volume/dilate.h"
#include "src/base/check.h"
#include "src/color/colorspace_math.h"

namespace cnerf::bake {
namespace {

/// What a new voxel has gathered so far.
struct Gathered {
  double optical = 0;  ///< density times the share of the new voxel's volume
  double light = 0;    ///< weights of the colours
  double luminance = 0;
  Vec3d rgb{};
};

/// The part of an old voxel that one new index covers along an axis.
struct Overlap {
  int index;
  double share;  ///< of the new voxel's side
};

/// An old voxel is no wider than a new one: it touches two at most.
int overlaps_of(int old_index, double ratio, Overlap out[2]) {
  constexpr double kRounding = 1e-6;  // sizes that come out of files are halves of each other to a few digits less
  const double begin = old_index * ratio, end = (old_index + 1) * ratio;
  const int first = int(std::floor(begin + kRounding));
  const double border = first + 1.0;
  if (end <= border) {
    out[0] = {first, end - begin};
    return 1;
  }
  out[0] = {first, border - begin};
  out[1] = {first + 1, end - border};
  return out[1].share > kRounding ? 2 : 1;
}

std::uint64_t key_of(int i, int j, int k) {
  constexpr int kBias = 1 << 20;  // far beyond any resolution
  return std::uint64_t(i + kBias) << 42 | std::uint64_t(j + kBias) << 21 | std::uint64_t(k + kBias);
}
Vec3i indices_of(std::uint64_t key) {
  constexpr int kBias = 1 << 20, kMask = (1 << 21) - 1;
  return {int(key >> 42) - kBias, int(key >> 21 & kMask) - kBias, int(key & kMask) - kBias};
}

using Cells = std::unordered_map<std::uint64_t, Gathered>;

/// @param offset  of the old lattice in the new one, old voxels.
void gather(const Voxel& voxel, Vec3i offset, double ratio, double voxel_size, Cells& cells) {
  Overlap x[2], y[2], z[2];
  const int nx = overlaps_of(voxel.i + offset.x, ratio, x), ny = overlaps_of(voxel.j + offset.y, ratio, y),
            nz = overlaps_of(voxel.k + offset.z, ratio, z);
  const double emission = -std::expm1(-double(voxel.sigma) * voxel_size);
  for (int a = 0; a < nx; ++a) {
    for (int b = 0; b < ny; ++b) {
      for (int c = 0; c < nz; ++c) {
        const double share = x[a].share * y[b].share * z[c].share;
        Gathered& cell = cells[key_of(x[a].index, y[b].index, z[c].index)];
        cell.optical += share * voxel.sigma;
        cell.light += share * emission;
        cell.luminance += share * emission * voxel.luminance;
        cell.rgb += voxel.rgb.cast<double>() * (share * emission);
      }
    }
  }
}

Voxel voxel_of(std::uint64_t key, const Gathered& cell) {
  const Vec3i at = indices_of(key);
  const Vec3f rgb = (cell.rgb / cell.light).cast<float>();
  const Lab<float> lab = lab_from_linear_rgb(rgb);
  return {at.x, at.y, at.z, float(cell.optical), float(cell.luminance / cell.light), rgb, lab.a, lab.b};
}

}  // namespace

Volume resample_volume(const Volume& volume, int resolution) {
  CNERF_CHECK(!volume.voxels.empty() && volume.voxel_size > 0, "an empty volume cannot be resampled");
  CNERF_CHECK(resolution >= 1, "resolution must be positive");
  const int longest = std::max({volume.resolution.x, volume.resolution.y, volume.resolution.z});
  if (longest <= resolution) return volume;

  const double ratio = double(resolution) / longest;  // new voxels an old one
  Cells cells;
  cells.reserve(volume.voxels.size() / 2);
  for (const Voxel& voxel : volume.voxels) {
    if (voxel.sigma > 0) gather(voxel, {0, 0, 0}, ratio, volume.voxel_size, cells);
  }
  Volume result = volume;
  result.voxel_size = volume.voxel_size / ratio;
  for (int axis = 0; axis < 3; ++axis) {
    result.resolution[axis] = int(std::ceil(volume.resolution[axis] * ratio - 1e-9));
  }
  result.voxels.clear();
  for (const auto& [key, cell] : cells) {
    if (cell.light > 0) result.voxels.push_back(voxel_of(key, cell));
  }
  sort_voxels(result.voxels);
  return result;
}

Volume merged_volume(std::vector<Volume> volumes) {
  CNERF_CHECK(!volumes.empty(), "there is no volume to merge");
  Volume merged = std::move(volumes.back());
  volumes.pop_back();
  if (volumes.empty()) return merged;
  Cells cells;
  for (const Volume& finer : volumes) {
    const Vec3d shift = (finer.origin - merged.origin) / finer.voxel_size;
    const Vec3i offset{int(std::lround(shift.x)), int(std::lround(shift.y)), int(std::lround(shift.z))};
    for (const Voxel& voxel : finer.voxels) {
      if (voxel.sigma > 0) gather(voxel, offset, finer.voxel_size / merged.voxel_size, finer.voxel_size, cells);
    }
  }
  std::erase_if(merged.voxels, [](const Voxel& voxel) { return !(voxel.sigma > 0); });  // dilated into the holes
  for (const auto& [key, cell] : cells) {
    if (cell.light > 0) merged.voxels.push_back(voxel_of(key, cell));
  }
  sort_voxels(merged.voxels);
  return merged;
}

}  // namespace cnerf::bake
