#include "src/engine/pixel_samples.h"

#include <utility>

#include "src/base/parallel.h"

namespace cnerf {

PixelSamples with_room_for(std::vector<std::size_t> offsets) {
  PixelSamples pixels;
  pixels.positions.resize(offsets.back());
  pixels.weights.resize(offsets.back());
  pixels.luminance.resize(offsets.back());
  pixels.offsets = std::move(offsets);
  return pixels;
}

PixelSamples pixel_samples(std::span<const Ray> rays, std::span<const WeightedSample> samples,
                           std::span<const std::size_t> offsets) {
  constexpr std::size_t kGrain = 512;  // rays of a parallel piece of work
  PixelSamples pixels = with_room_for({offsets.begin(), offsets.end()});
  parallel_each(rays.size(), kGrain, [&](std::size_t r) {
    for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
      pixels.positions[s] = rays[r].at(samples[s].t);
      pixels.weights[s] = samples[s].weight;
      pixels.luminance[s] = samples[s].luminance;
    }
  });
  return pixels;
}

}  // namespace cnerf
