#pragma once
/// The rays of a training step and what their pixels show: a pure function of (seed, step, ray), the same for every
/// field that is trained and on every device.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/base/host_device.h"
#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "src/render/training_views.h"
#include "src/render/view_correction.h"

namespace cnerf {

/// What the pixel of a training ray shows.
struct RayTarget {
  float luminance = 0;   ///< linear Y over black
  float coverage = 1;    ///< alpha of the pixel
  float background = 0;  ///< linear Y put behind ray and pixel alike
  float sky = 0;         ///< linear Y behind the ray that the pixel shows, as its view has it
  float gain = 1;        ///< of the view: its light over that of the scene
  DepthHint depth;

  /// What is to be seen with the background behind it; linear Y.
  [[nodiscard]] CNERF_HD float wanted() const { return luminance + (1.0f - coverage) * background; }
};

struct ObservedRay {
  Ray ray;
  RayTarget target;
  float jitter = 0;        ///< in [0, 1): of the samples along the ray
  std::uint32_t view = 0;  ///< that shows it
};

struct ImageSize {
  int width = 0, height = 0;
};
struct PickedPixel {
  std::uint32_t view = 0;
  int x = 0, y = 0;
};

/// A pixel that is masked out is drawn again, but not for ever.
inline constexpr int kFirstPicks = 16, kMorePicks = 4096;

/// A random pixel of a random view.
/// @param views    see `observe_ray`
/// @param attempt  of `of`: draws again when the first pick was masked out
template <typename Views>
CNERF_HD PickedPixel pick_pixel(const Views& views, const CounterRng& rng, std::uint64_t ray, int attempt, int of) {
  const std::uint64_t at = (ray * std::uint64_t(of) + std::uint64_t(attempt)) * 4;
  const std::uint32_t v = rng.below(at, views.count());
  const ImageSize image = views.size_of(v);
  return {v, int(rng.below(at + 1, std::uint32_t(image.width))), int(rng.below(at + 2, std::uint32_t(image.height)))};
}

/// @tparam Views  count(), and of view v: size_of(v), camera(v), correction(v), sky(v), depth(v, x, y); of its pixel
///                i = y * width + x: is_valid(v, i), luminance(v, i), coverage(v, i), sky_label(v, i)
template <typename Views>
[[nodiscard]] CNERF_HD ObservedRay observe_ray(const Views& views, std::uint64_t seed, std::uint64_t step,
                                               std::uint64_t ray) {
  const CounterRng picks(seed ^ named_stream("rays\0"), step), more(seed ^ named_stream("more"), step);
  PickedPixel picked;
  std::size_t pixel = 0;
  for (int attempt = 0; attempt < kFirstPicks + kMorePicks; ++attempt) {
    picked = attempt < kFirstPicks ? pick_pixel(views, picks, ray, attempt, kFirstPicks)
                                   : pick_pixel(views, more, ray, attempt - kFirstPicks, kMorePicks);
    pixel = std::size_t(picked.y) * std::size_t(views.size_of(picked.view).width) + std::size_t(picked.x);
    if (views.is_valid(picked.view, pixel)) break;
  }

  const CounterRng rng(seed ^ named_stream("jitt"), step);
  ObservedRay observed;
  const ViewCorrection correction = views.correction(picked.view);
  observed.view = picked.view;
  observed.ray = correction.applied_to(views.camera(picked.view).ray({picked.x + 0.5, picked.y + 0.5}));
  observed.target.gain = correction.gain();
  observed.target.luminance = views.luminance(picked.view, pixel);
  observed.target.coverage = views.coverage(picked.view, pixel);
  observed.target.depth = views.depth(picked.view, picked.x, picked.y);
  observed.jitter = rng.uniform(2 * ray);
  // Another background each time: what is transparent has to become empty and what is opaque solid. Over black, a dark
  // thing could as well be a hole, and thin fog everywhere explains a dim picture.
  const float random = rng.uniform(2 * ray + 1);
  observed.target.background = luminance_from_lightness(100.0f * random);
  // The way to the sky is as empty as what is transparent; every other time its light is compared, which tells the
  // view's exposure. Where the sky only may be seen, nothing is asked to be solid.
  const SkyLabel label = views.sky_label(picked.view, pixel);
  if (label == SkyLabel::kSky && random < 0.5f) {
    observed.target.background = luminance_from_lightness(200.0f * random);
    observed.target.luminance = observed.target.coverage = 0;
    observed.target.depth = {};
  } else if (label != SkyLabel::kScene) {
    observed.target.background = 0;
    observed.target.sky = observed.target.gain * views.sky(picked.view).along(observed.ray.direction);
  }
  return observed;
}

/// @param corrections  of the views; empty: none
[[nodiscard]] ObservedRay observe_ray(const std::vector<TrainingView>& views, std::uint64_t seed, std::uint64_t step,
                                      std::uint64_t ray, std::span<const ViewCorrection> corrections = {});

}  // namespace cnerf
