#pragma once
/// The rays of a training step and what their pixels show: a pure function of (seed, step, ray), the same for every
/// field that is trained and on every device.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/base/host_device.h"
#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "src/render/training_views.h"

namespace cnerf {

/// How a step chooses its pixels.
struct PixelSampling {
  int patch_size = 0;  ///< 0: independent pixels; K: rays K*K n .. K*K (n + 1) - 1 form a patch
  float scale_min = 0.3f, scale_max = 0.7f;
};

/// What the pixel of a training ray shows.
struct RayTarget {
  float luminance = 0;   ///< linear Y over black
  float coverage = 1;    ///< alpha of the pixel
  float background = 0;  ///< linear Y put behind ray and pixel alike

  /// What is to be seen with the background behind it; linear Y.
  [[nodiscard]] CNERF_HD float wanted() const { return luminance + (1.0f - coverage) * background; }
};

struct ObservedRay {
  Ray ray;
  RayTarget target;
  float jitter = 0;  ///< in [0, 1): of the samples along the ray
};

struct ImageSize {
  int width = 0, height = 0;
};
struct PickedPixel {
  std::uint32_t view = 0;
  int x = 0, y = 0;
};

/// @param views    see `observe_ray`
/// @param attempt  draws again when the first pick was masked out
template <typename Views>
CNERF_HD PickedPixel pick_pixel(const Views& views, const PixelSampling& sampling, const CounterRng& rng,
                                std::uint64_t ray, int attempt) {
  if (sampling.patch_size == 0 || attempt > 0) {
    const std::uint64_t at = (ray * 16 + std::uint64_t(attempt)) * 4;
    const std::uint32_t v = rng.below(at, views.count());
    const ImageSize image = views.size_of(v);
    return {v, int(rng.below(at + 1, std::uint32_t(image.width))), int(rng.below(at + 2, std::uint32_t(image.height)))};
  }
  // Paper, Eq. patch sampling: (s x + u, s y + v) for x, y in -K/2 .. K/2 - 1, with s K pixels = share of the short
  // side.
  const auto k = std::uint64_t(sampling.patch_size);
  const std::uint64_t patch = ray / (k * k), within = ray % (k * k);
  const std::uint64_t at = (std::uint64_t(1) << 40) + patch * 4;
  const std::uint32_t v = rng.below(at, views.count());
  const ImageSize image = views.size_of(v);
  const float share = sampling.scale_min + (sampling.scale_max - sampling.scale_min) * rng.uniform(at + 1);
  const float side = share * float(std::min(image.width, image.height));
  const float left = (float(image.width) - side) * rng.uniform(at + 2);
  const float top = (float(image.height) - side) * rng.uniform(at + 3);
  const float spacing = side / float(k);
  return {v, std::min(image.width - 1, int(left + (float(within % k) + 0.5f) * spacing)),
          std::min(image.height - 1, int(top + (float(within / k) + 0.5f) * spacing))};
}

/// @tparam Views  count(), and of view v: size_of(v), camera(v); of its pixel i = y * width + x: is_valid(v, i),
///                luminance(v, i), coverage(v, i)
template <typename Views>
[[nodiscard]] CNERF_HD ObservedRay observe_ray(const Views& views, const PixelSampling& sampling, std::uint64_t seed,
                                               std::uint64_t step, std::uint64_t ray) {
  // A pixel that is masked out is drawn again, but not for ever.
  constexpr int kAttempts = 16;
  const CounterRng picks(seed ^ named_stream("rays\0"), step);
  PickedPixel picked;
  std::size_t pixel = 0;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    picked = pick_pixel(views, sampling, picks, ray, attempt);
    pixel = std::size_t(picked.y) * std::size_t(views.size_of(picked.view).width) + std::size_t(picked.x);
    if (views.is_valid(picked.view, pixel)) break;
  }

  const CounterRng rng(seed ^ named_stream("jitt"), step);
  ObservedRay observed;
  observed.ray = views.camera(picked.view).ray({picked.x + 0.5, picked.y + 0.5});
  observed.target.luminance = views.luminance(picked.view, pixel);
  observed.target.coverage = views.coverage(picked.view, pixel);
  observed.jitter = rng.uniform(2 * ray);
  // Another background each time: what is transparent has to become empty and what is opaque solid. Over black, a dark
  // thing could as well be a hole, and thin fog everywhere explains a dim picture.
  observed.target.background = luminance_from_lightness(100.0f * rng.uniform(2 * ray + 1));
  return observed;
}

[[nodiscard]] ObservedRay observe_ray(const std::vector<TrainingView>& views, const PixelSampling& sampling,
                                      std::uint64_t seed, std::uint64_t step, std::uint64_t ray);

}  // namespace cnerf
