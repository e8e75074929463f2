#include "src/engine/color_engines.h"

#include "src/base/check.h"
#include "src/base/error.h"

namespace cnerf {

void ColorEngine::share_steps(const StepShare& share) {
  if (!share.is_whole()) throw DeviceError("this device's engines do not share a step with other processes");
}

double ColorBinEngine::step(const PixelSamples& pixels, std::span<const SoftLabel> labels,
                            std::span<const float> pixel_weights, const ChromaLossWeights& more, float learning_rate) {
  CNERF_CHECK_EQ(labels.size(), pixels.pixels());
  count_step();
  return labels.empty() ? 0 : fit(pixels, labels, pixel_weights, more, learning_rate);
}

double ColorFieldEngine::step(const PixelSamples& pixels, std::span<const Ab> targets,
                              std::span<const float> pixel_weights, AbLoss loss, float learning_rate) {
  CNERF_CHECK_EQ(targets.size(), pixels.pixels());
  count_step();
  return targets.empty() ? 0 : fit(pixels, targets, pixel_weights, loss, learning_rate);
}

}  // namespace cnerf
