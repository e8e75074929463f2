#pragma once
/// The colour of a point from its luminance and chromaticity, brought into gamut.

#include "src/base/vec3.h"
#include "src/field/color_field.h"

namespace cnerf::bake {

/// Linear Rec.709 and its Lab a, b for a luminance and a chromaticity. In gamut: chroma gives way at constant lightness
/// and hue. Grey gives three equal numbers and a = b = 0 exactly.
struct VoxelColor {
  Vec3f rgb{};
  float a = 0, b = 0;
};
[[nodiscard]] VoxelColor voxel_color(float luminance, Chromaticity chromaticity);

}  // namespace cnerf::bake
