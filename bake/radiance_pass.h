#pragma once
/// Second pass of a bake: luminance as the cameras see it, and colour.

#include <functional>
#include <vector>

#include "bake/bake_camera.h"
#include "bake/bake_levels.h"
#include "bake/baked_volume.h"

namespace cnerf {

/// Linear Rec.709 and its Lab a, b for a luminance and a chromaticity. In gamut: chroma gives way at constant lightness
/// and hue. Grey gives three equal numbers and a = b = 0 exactly.
struct VoxelColor {
  Vec3f rgb{};
  float a = 0, b = 0;
};
[[nodiscard]] VoxelColor voxel_color(float luminance, Chromaticity chromaticity);

/// The voxels of a density pass with their colours, by brick; those that no camera sees are left out unless
/// `keep_unseen`. So are those that give less than `weight_threshold` of a pixel's light (transmittance times opacity)
/// even to the camera that sees them best. Luminance is the mean over the cameras that see the voxel, weighted by
/// transmittance; where none does, and everywhere when there are no cameras, over the six axis directions.
/// @param levels  all levels of the bake; `level` is the one to bake, the others stand in its light.
/// @param advance  as in bake_density.
/// @throws ContractError  when the field answers a luminance or chromaticity that is not finite.
[[nodiscard]] std::vector<BakedVoxel> bake_radiance(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                                    const std::vector<BakeLevel>& levels, std::size_t level,
                                                    const BakeOptions& options,
                                                    const std::function<void(double)>& advance);

}  // namespace cnerf
