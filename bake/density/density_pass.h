#pragma once
/// First pass of a bake: density.

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "bake/lattice/brick_grid.h"
#include "bake/lattice/plan.h"

namespace cnerf::bake {

/// A voxel dense enough to be kept. There are many of these, so they are small and kept on disk.
struct DenseVoxel {
  float sigma = 0;                         ///< 1/world unit
  std::uint32_t brick = 0;                 ///< in its plane of bricks
  std::uint16_t offset = 0;                ///< in its brick, see brick_offset
  std::array<std::uint8_t, 3> centroid{};  ///< of its matter, in 256ths of the voxel: where its colour is asked for
  std::uint8_t unused = 0;

  [[nodiscard]] Vec3d centroid_in_voxel() const {
    return Vec3d{centroid[0] + 0.5, centroid[1] + 0.5, centroid[2] + 0.5} / 256.0;
  }
};

/// Bakes are made plane by plane of bricks: plane p holds the voxels with 8 p <= i < 8 p + 8.
[[nodiscard]] int plane_count(const Plan& plan);
/// Bricks along y and z of any plane; brick b of a plane is at (b / z, b % z).
[[nodiscard]] Vec3i plane_bricks(const Plan& plan);
[[nodiscard]] Vec3i brick_min_of(const Plan& plan, int plane, std::uint32_t brick);

/// Largest density worth storing: an optical depth of 20 in one voxel is opaque (transmittance 2e-9).
[[nodiscard]] double max_sigma(double voxel_size);

/// Density of a voxel is -ln(mean transmittance) / h over its sub-samples, each taken as exp(-sigma h): the voxel then
/// lets through as much light as the field does. Same result for any number of threads.
/// @return the kept voxels of a plane, by brick and offset.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
[[nodiscard]] std::vector<DenseVoxel> bake_density_plane(const ColorField& field, const Plan& plan,
                                                         const Options& options, int plane);
/// The same for some bricks of a plane only.
[[nodiscard]] std::vector<DenseVoxel> bake_density_bricks(const ColorField& field, const Plan& plan,
                                                          const Options& options, int plane,
                                                          std::span<const std::uint32_t> bricks);

/// A grid for the densities of a plan, all 0, and what puts a plane of them there.
[[nodiscard]] BrickGrid<float> empty_density(const Plan& plan);
void put_plane(std::span<const DenseVoxel> voxels, int plane, BrickGrid<float>& sigma);

/// Whether voxels can be what a plane of a plan came to: in order, inside of its bricks, of finite density.
[[nodiscard]] bool is_plane_of(const Plan& plan, std::span<const DenseVoxel> voxels);

/// All planes.  @param advance  told the share done, in [0, 1], between planes; may throw.
[[nodiscard]] BrickGrid<float> bake_density(const ColorField& field, const Plan& plan, const Options& options,
                                            const std::function<void(double)>& advance);

}  // namespace cnerf::bake
