#pragma once
/// First pass of a bake: density, brick by brick.

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "bake/bake_plan.h"
#include "bake/brick_grid.h"

namespace cnerf {

/// A voxel dense enough to be kept. Its density is in the grid; there are many of these, so they are small.
struct DenseVoxel {
  std::uint16_t offset = 0;                ///< in its brick, see brick_offset
  std::array<std::uint8_t, 3> centroid{};  ///< of its matter, in 256ths of the voxel: where its colour is asked for

  [[nodiscard]] Vec3d centroid_in_voxel() const {
    return Vec3d{centroid[0] + 0.5, centroid[1] + 0.5, centroid[2] + 0.5} / 256.0;
  }
};

struct DensityPass {
  BrickGrid<float> sigma;                       ///< 1/world unit; only kept voxels, else 0
  std::vector<std::vector<DenseVoxel>> bricks;  ///< kept voxels of each brick of `sigma`, by offset
};

/// Largest density worth storing: an optical depth of 20 in one voxel is opaque (transmittance 2e-9).
[[nodiscard]] double max_sigma(double voxel_size);

/// Density of a voxel is -ln(mean transmittance) / h over its sub-samples, each taken as exp(-sigma h): the voxel then
/// lets through as much light as the field does. Same result for any number of threads.
/// @param advance  told the share done, in [0, 1], between batches; may throw.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
[[nodiscard]] DensityPass bake_density(const ColorField& field, const BakePlan& plan, const BakeOptions& options,
                                       const std::function<void(double)>& advance);

/// Runs `task(i)` for i in [0, tasks) in parallel batches, with `advance(share)` between them on the calling thread.
void parallel_batches(std::size_t tasks, const std::function<void(std::size_t)>& task,
                      const std::function<void(double)>& advance);

}  // namespace cnerf
