#pragma once
/// Random pixels as stage 2 knows them: few samples a ray, near a surface.

#include <algorithm>
#include <cmath>
#include <vector>

#include "src/base/rng.h"
#include "src/color/ab_bins.h"
#include "src/engine/color_engines.h"

namespace cnerf::test {

/// Every ninth pixel has hardly any opacity, every thirteenth no sample at all.
/// @param most_samples  of a pixel; from 1 on
inline PixelSamples random_pixels(int count, int most_samples, std::uint64_t seed) {
  SequentialRng rng(seed, 9);
  PixelSamples pixels;
  for (int p = 0; p < count; ++p) {
    Vec3f at = {rng.uniform(), rng.uniform(), rng.uniform()};
    const Vec3f direction = normalized(Vec3f{rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)});
    const int samples = p % 13 == 12 ? 0 : 1 + int(rng.uniform() * float(most_samples));
    float left = p % 9 == 8 ? 0.005f : 1.0f;
    for (int s = 0; s < samples; ++s) {
      const float weight = left * rng.uniform(0.1f, 0.5f);
      left -= weight;
      pixels.positions.push_back(at);  // may leave the box: it is clamped
      pixels.weights.push_back(weight);
      pixels.luminance.push_back(rng.uniform(0.05f, 0.9f));
      at += direction * (1.0f / 256);
    }
    pixels.offsets.push_back(pixels.positions.size());
  }
  return pixels;
}

/// Smooth colours of the pixels' first samples.
inline std::vector<Ab> colors_of(const PixelSamples& pixels) {
  std::vector<Ab> colors;
  for (std::size_t p = 0; p < pixels.pixels(); ++p) {
    const std::size_t first = pixels.offsets[p];
    const Vec3f at = first < pixels.offsets[p + 1] ? pixels.positions[first] : Vec3f{};
    colors.push_back({40 * std::sin(7 * at.x), 40 * std::cos(5 * at.y + at.z)});
  }
  return colors;
}

}  // namespace cnerf::test
