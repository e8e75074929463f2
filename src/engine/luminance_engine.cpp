#include "src/engine/luminance_engine.h"

#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

/// Whose samples lie in the host's memory anyway.
class HostTracedPixels final : public TracedPixels {
 public:
  HostTracedPixels(std::span<const Ray> rays, std::span<const WeightedSample> samples,
                   std::span<const std::size_t> offsets)
      : samples_(pixel_samples(rays, samples, offsets)), results_(rays.size()) {
    parallel_each(rays.size(), 256, [&](std::size_t r) {
      RayResult& seen = results_[r];
      for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
        seen.luminance += samples[s].weight * samples[s].luminance;
        seen.opacity += samples[s].weight;
        seen.depth += samples[s].weight * samples[s].t;
      }
      if (seen.opacity > 0) seen.depth /= seen.opacity;
    });
  }
  [[nodiscard]] std::span<const RayResult> results() const override { return results_; }
  [[nodiscard]] const PixelSamples& samples() const override { return samples_; }

 private:
  PixelSamples samples_;
  std::vector<RayResult> results_;
};

}  // namespace

void LuminanceEngine::share_steps(const StepShare& share) {
  if (!share.is_whole()) throw DeviceError("this device's engines do not share a step with other processes");
}

std::unique_ptr<TracedPixels> LuminanceEngine::trace_pixels(std::span<const Ray> rays, const MarchSettings& march,
                                                            const RenderEffort& effort) const {
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  trace(rays, march, effort, samples, offsets);
  return std::make_unique<HostTracedPixels>(rays, samples, offsets);
}

void LuminanceEngine::render_view(const UnitCamera& camera, const MarchSettings& march, const RenderEffort& effort,
                                  std::span<RayResult> results) const {
  std::vector<Ray> rays(results.size());
  parallel_each(rays.size(), 512, [&](std::size_t p) { rays[p] = camera.ray_of_pixel(p); });
  render(rays, march, effort, results);
}

}  // namespace cnerf
