#pragma once
/// A photograph as plain numbers.

#include <vector>

#include "src/capture/mono_image.h"

namespace cnerf {

/// Linear luminance, row by row.  [H, W]
[[nodiscard]] inline std::vector<float> luminance_plane(const MonoImage& image) {
  std::vector<float> luminance(image.pixel_count());
  for (std::size_t i = 0; i < luminance.size(); ++i) luminance[i] = image.luminance(i);
  return luminance;
}

}  // namespace cnerf
