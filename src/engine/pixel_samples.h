#pragma once
/// What stage 2 knows of pixels: the few samples that carry their opacity, with frozen weights.

#include <cstddef>
#include <vector>

#include "src/base/vec3.h"

namespace cnerf {

/// Samples of R pixels, pixel by pixel, front to back.
struct PixelSamples {
  std::vector<Vec3f> positions;            ///< [S], unit space
  std::vector<float> weights;              ///< [S], w_i >= 0; a pixel's sum is its opacity
  std::vector<float> luminance;            ///< [S], linear Y
  std::vector<std::size_t> offsets = {0};  ///< [R + 1]

  [[nodiscard]] std::size_t pixels() const { return offsets.size() - 1; }
};

}  // namespace cnerf
