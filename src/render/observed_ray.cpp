#include "src/render/observed_ray.h"

#include "src/color/colorspace_math.h"

namespace cnerf {

ObservedRay observe_ray(const std::vector<TrainingView>& views, const PixelSampling& sampling, std::uint64_t seed,
                        std::uint64_t step, std::uint64_t ray) {
  PickedPixel pixel;
  std::size_t index = 0;
  for (int attempt = 0; attempt < kPickAttempts; ++attempt) {
    pixel = pick_pixel(views, sampling, seed, step, ray, attempt);
    index = std::size_t(pixel.y) * std::size_t(views[pixel.view].image->width) + std::size_t(pixel.x);
    if (views[pixel.view].image->valid(index)) break;
  }
  const TrainingView& view = views[pixel.view];
  const CounterRng rng = ray_rng(seed, step);
  ObservedRay observed;
  observed.ray = view.camera.ray({pixel.x + 0.5, pixel.y + 0.5});
  observed.target = view.image->luminance(index);
  observed.coverage = view.image->coverage(index);
  observed.jitter = rng.uniform(2 * ray);
  // Another background each time: what is transparent has to become empty and what is opaque solid. Over black, a dark
  // thing could as well be a hole, and thin fog everywhere explains a dim picture.
  observed.background = luminance_from_lightness(100.0f * rng.uniform(2 * ray + 1));
  return observed;
}

}  // namespace cnerf
