#include "bake/color/voxel_color.h"

#include <algorithm>

#include "src/color/colorspace_math.h"

namespace cnerf::bake {
namespace {

bool in_gamut(Vec3f rgb, float luminance) {
  const float top = std::max(1.0f, luminance);
  for (int channel = 0; channel < 3; ++channel) {
    if (rgb[channel] < 0 || rgb[channel] > top) return false;
  }
  return true;
}

}  // namespace

VoxelColor voxel_color(float luminance, Chromaticity chromaticity) {
  if (chromaticity.x == 1 && chromaticity.z == 1) return {{luminance, luminance, luminance}, 0, 0};
  const Vec3f xyz{luminance * chromaticity.x, luminance, luminance * chromaticity.z};
  VoxelColor color;
  color.rgb = linear_rgb_from_relative_xyz(xyz);
  if (!in_gamut(color.rgb, luminance)) {
    color.rgb = gamut_mapped_linear_rgb_from_lab(lab_from_linear_rgb(color.rgb));
  }
  const Lab<float> lab = lab_from_linear_rgb(color.rgb);
  color.a = lab.a;
  color.b = lab.b;
  return color;
}

}  // namespace cnerf::bake
