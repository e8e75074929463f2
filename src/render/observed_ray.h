#pragma once
/// The rays of a training step and what their pixels show: a pure function of (seed, step, ray), the same for every
/// field that is trained.

#include <cstdint>
#include <vector>

#include "src/render/pixel_sampler.h"

namespace cnerf {

struct ObservedRay {
  Ray ray;
  float target = 0;      ///< linear Y over black
  float coverage = 1;    ///< alpha of the pixel
  float background = 0;  ///< linear Y put behind ray and pixel alike
  float jitter = 0;      ///< in [0, 1): of the samples along the ray

  /// What is to be seen with the background behind it; linear Y.
  [[nodiscard]] float wanted() const { return target + (1.0f - coverage) * background; }
};

[[nodiscard]] ObservedRay observe_ray(const std::vector<TrainingView>& views, const PixelSampling& sampling,
                                      std::uint64_t seed, std::uint64_t step, std::uint64_t ray);

}  // namespace cnerf
