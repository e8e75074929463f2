#include "src/train/chroma/distillation.h"

#include <algorithm>
#include <cmath>

#include "src/base/rng.h"
#include "src/optim/adam.h"

namespace cnerf {
namespace {

constexpr int kPixels = 8192;  // per step
constexpr int kMeasuredPixels = 4 * kPixels;
constexpr double kRate = 1e-2, kFinalRate = 1e-3;  // of its own: distances want smaller steps than classes
constexpr std::uint64_t kMeasuredStream = std::uint64_t(1) << 40;  // apart from the steps'

/// Random visible pixels of all views.
PixelSamples random_pixels(const Session& session, int count, std::uint64_t stream) {
  const CounterRng rng(std::uint64_t(session.options.seed) ^ named_stream("dist"), stream);
  const auto views = session.views();
  std::vector<ViewPixel> wanted;
  for (int i = 0; i < count; ++i) {
    const std::uint32_t v = rng.below(2 * std::uint64_t(i), std::uint32_t(views.size()));
    const CachedView& view = views[v];
    const std::uint32_t pixel = rng.below(2 * std::uint64_t(i) + 1, std::uint32_t(view.width * view.height));
    if (view.opacity[pixel] >= kLeastColoredOpacity) wanted.push_back({v, pixel});
  }
  return pixel_samples(views, wanted);
}

}  // namespace

void distill(Session& session) {
  const int steps = session.options.distill_steps;
  ColorFieldEngine& field = *session.model.chromaticity;
  while (field.step_count() < steps) {
    const long step = field.step_count();
    const PixelSamples pixels = random_pixels(session, kPixels, std::uint64_t(step));
    if (pixels.pixels() == 0) break;
    session.loss =
        field.step(pixels, session.model.decode(pixels), decayed_rate(kRate, kFinalRate, double(step) / steps));
    session.after_step("stage 2: colour for baking", "ab distance", step + 1, steps);
  }
}

double bake_ab_distance(const Session& session) {
  const PixelSamples pixels = random_pixels(session, kMeasuredPixels, kMeasuredStream);
  const std::vector<Ab> decoded = session.model.decode(pixels);
  std::vector<Ab> baked(pixels.pixels());
  session.model.chromaticity->composite(pixels, baked);
  double total = 0;
  for (std::size_t p = 0; p < baked.size(); ++p) {
    total += std::hypot(baked[p].a - decoded[p].a, baked[p].b - decoded[p].b);
  }
  return total / double(std::max<std::size_t>(baked.size(), 1));
}

}  // namespace cnerf
