#pragma once
/// What is seen of pixels: the few samples of their rays that carry their opacity.

#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

#include "src/base/vec3.h"
#include "src/render/ray.h"

namespace cnerf {

/// What a ray sees. Linear light, over black.
struct RayResult {
  float luminance = 0;
  float opacity = 0;
  float depth = 0;  ///< expected t of what is seen, unit space; 0 when nothing is
};

/// A sample that carries part of a ray's opacity.
struct WeightedSample {
  float t = 0;
  float weight = 0;
  float luminance = 0;
};

/// What stage 2 knows of R pixels: the few samples that carry their opacity, with frozen weights; pixel by pixel, front
/// to back.
struct PixelSamples {
  std::vector<Vec3f> positions;            ///< [S], unit space
  std::vector<float> weights;              ///< [S], w_i >= 0; a pixel's sum is its opacity
  std::vector<float> luminance;            ///< [S], linear Y
  std::vector<std::size_t> offsets = {0};  ///< [R + 1]

  [[nodiscard]] std::size_t pixels() const { return offsets.size() - 1; }
  [[nodiscard]] float opacity(std::size_t pixel) const {
    return std::accumulate(weights.begin() + std::ptrdiff_t(offsets[pixel]),
                           weights.begin() + std::ptrdiff_t(offsets[pixel + 1]), 0.0f);
  }
};

/// Room for samples of pixels that begin there.
[[nodiscard]] PixelSamples with_room_for(std::vector<std::size_t> offsets);
/// Of rays and the samples on them.
/// @param offsets  [rays + 1], where each ray's samples begin
[[nodiscard]] PixelSamples pixel_samples(std::span<const Ray> rays, std::span<const WeightedSample> samples,
                                         std::span<const std::size_t> offsets);

/// Pixels of rays that an engine traced. Their samples stay in its memory until somebody wants them elsewhere.
class TracedPixels {
 public:
  virtual ~TracedPixels() = default;
  /// What the rays see.  [R]
  [[nodiscard]] virtual std::span<const RayResult> results() const = 0;
  /// Copied to the host's memory when they are first asked for. For one caller at a time.
  [[nodiscard]] virtual const PixelSamples& samples() const = 0;
};

}  // namespace cnerf
