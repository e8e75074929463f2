#pragma once
/// Small baked volumes with known content.

#include "bake/baked_volume.h"

namespace cnerf::test {

/// Voxels [min, max) of one density and colour, not dilated, in a world whose voxel (0, 0, 0) starts at (1, 2, 3).
inline BakedVolume block_volume(Vec3i min, Vec3i max, float sigma, double voxel_size = 0.05,
                                Vec3f rgb = {0.2f, 0.5f, 0.8f}) {
  BakedVolume volume;
  volume.origin = {1, 2, 3};
  volume.voxel_size = voxel_size;
  volume.resolution = max + Vec3i{4, 4, 4};
  volume.frame = {{1.5, 2.5, 3.5}, 0.125, 2};
  volume.colorizer = "builtin";
  volume.take = "first";
  for (int i = min.x; i < max.x; ++i)
    for (int j = min.y; j < max.y; ++j)
      for (int k = min.z; k < max.z; ++k) volume.voxels.push_back({i, j, k, sigma, 0.457f, rgb, -3.5f, -31.25f});
  return volume;
}

}  // namespace cnerf::test
