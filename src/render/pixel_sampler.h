#pragma once
/// Which pixels a training step looks at: a pure function of (seed, step, ray), the same on every device.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "src/base/host_device.h"
#include "src/base/rng.h"
#include "src/render/training_views.h"

namespace cnerf {

struct PixelSampling {
  int patch_size = 0;  ///< 0: independent pixels; K: rays K*K n .. K*K (n + 1) - 1 form a patch
  float scale_min = 0.3f, scale_max = 0.7f;
};

/// Picks of a pixel before one that is masked out is taken after all.
inline constexpr int kPickAttempts = 16;

struct PickedPixel {
  std::uint32_t view = 0;
  int x = 0, y = 0;
};

struct ImageSize {
  int width = 0, height = 0;
};

/// Jitter of a ray's samples and the background behind it come from this generator, at 2 ray and 2 ray + 1.
[[nodiscard]] CNERF_HD inline CounterRng ray_rng(std::uint64_t seed, std::uint64_t step) {
  return {seed ^ named_stream("jitt"), step};
}

/// @param size_of  the ImageSize of view v
/// @param attempt  draws again when the first pick was masked out
template <typename SizeOf>
CNERF_HD PickedPixel pick_pixel(std::uint32_t n_views, SizeOf&& size_of, const PixelSampling& sampling,
                                std::uint64_t seed, std::uint64_t step, std::uint64_t ray, int attempt) {
  const CounterRng rng(seed ^ named_stream("rays\0"), step);
  if (sampling.patch_size == 0 || attempt > 0) {
    const std::uint64_t at = (ray * 16 + std::uint64_t(attempt)) * 4;
    const std::uint32_t v = rng.below(at, n_views);
    const ImageSize image = size_of(v);
    return {v, int(rng.below(at + 1, std::uint32_t(image.width))), int(rng.below(at + 2, std::uint32_t(image.height)))};
  }
  // Paper, Eq. patch sampling: (s x + u, s y + v) for x, y in -K/2 .. K/2 - 1, with s K pixels = share of the short
  // side.
  const auto k = std::uint64_t(sampling.patch_size);
  const std::uint64_t patch = ray / (k * k), within = ray % (k * k);
  const std::uint64_t at = (std::uint64_t(1) << 40) + patch * 4;
  const std::uint32_t v = rng.below(at, n_views);
  const ImageSize image = size_of(v);
  const float share = sampling.scale_min + (sampling.scale_max - sampling.scale_min) * rng.uniform(at + 1);
  const float side = share * float(std::min(image.width, image.height));
  const float left = (float(image.width) - side) * rng.uniform(at + 2);
  const float top = (float(image.height) - side) * rng.uniform(at + 3);
  const float spacing = side / float(k);
  return {v, std::min(image.width - 1, int(left + (float(within % k) + 0.5f) * spacing)),
          std::min(image.height - 1, int(top + (float(within / k) + 0.5f) * spacing))};
}
inline PickedPixel pick_pixel(const std::vector<TrainingView>& views, const PixelSampling& sampling, std::uint64_t seed,
                              std::uint64_t step, std::uint64_t ray, int attempt) {
  const auto size_of = [&](std::uint32_t v) { return ImageSize{views[v].image->width, views[v].image->height}; };
  return pick_pixel(std::uint32_t(views.size()), size_of, sampling, seed, step, ray, attempt);
}

}  // namespace cnerf
