#pragma once
/// find_seeing of sight_math.h for many points at once on the GPU.

#include <cuda_runtime_api.h>

#include "bake/visibility/sight_math.h"

namespace cnerf::bake {

/// A BrickGrid<float> in device memory, whose lattice starts at (0, 0, 0).
struct DeviceBricks {
  const std::int32_t* numbers = nullptr;  ///< [counts.x][counts.y][counts.z]; -1 where there is no brick
  const float* values = nullptr;          ///< [bricks][kBrickVoxels]
  Vec3i lattice{}, counts{};              ///< voxels and bricks along each axis

  [[nodiscard]] CNERF_HD Vec3i min() const { return {}; }
  [[nodiscard]] CNERF_HD Vec3i size() const { return lattice; }
  [[nodiscard]] CNERF_HD const float* find_brick(Vec3i relative) const {
    const Vec3i c = brick_part(relative);
    const std::int32_t number = numbers[(std::size_t(c.x) * counts.y + c.y) * counts.z + c.z];
    return number < 0 ? nullptr : values + std::size_t(number) * kBrickVoxels;
  }
  [[nodiscard]] CNERF_HD static int clear_bricks(Vec3i /*relative*/) { return 0; }  // not known here
};

/// All pointers are to device memory; those of the scene as well.
struct SightJob {
  SightScene<DeviceBricks> scene;
  int level = 0;                         ///< that the points belong to
  const Sight* sights = nullptr;         ///< [count]
  const std::int32_t* orders = nullptr;  ///< [orders][scene.eye_count]
  std::uint32_t count = 0;
  SeenBy* seen = nullptr;          ///< [count][scene.views]
  std::int32_t* counts = nullptr;  ///< [count]
};

void find_seeing_all(const SightJob& job, cudaStream_t stream);

}  // namespace cnerf::bake
