#include "src/train/chroma/distillation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/base/rng.h"
#include "src/optim/adam.h"

namespace cnerf {
namespace {

constexpr int kPixels = 8192;  // per step
constexpr int kMeasuredPixels = 4 * kPixels;
constexpr double kRate = 1e-2, kFinalRate = 1e-3;  // of its own: distances want smaller steps than classes
constexpr std::uint64_t kMeasuredStream = std::uint64_t(1) << 40;  // apart from the steps'

/// Random visible pixels of all views.
std::vector<ViewPixel> random_pixels(const Session& session, int count, std::uint64_t stream) {
  const CounterRng rng(std::uint64_t(session.options.seed) ^ named_stream("dist"), stream);
  const auto views = session.views();
  std::vector<ViewPixel> wanted;
  for (int i = 0; i < count; ++i) {
    const std::uint32_t v = rng.below(2 * std::uint64_t(i), std::uint32_t(views.size()));
    const CachedView& view = views[v];
    const std::uint32_t pixel = rng.below(2 * std::uint64_t(i) + 1, std::uint32_t(view.width * view.height));
    if (view.opacity[pixel] >= kLeastColoredOpacity) wanted.push_back({v, pixel});
  }
  return wanted;
}

/// Decoded colours of pixels. They stay the same all the time, and steps draw most pixels several times.
class DecodedColors {
 public:
  explicit DecodedColors(const Session& session) : session_(session) {
    for (const CachedView& view : session.views()) colors_.emplace_back(view.luminance.size(), kUnknown);
  }
  [[nodiscard]] std::vector<Ab> of(std::span<const ViewPixel> pixels) {
    std::vector<ViewPixel> unknown;
    for (const ViewPixel& pixel : pixels) {
      Ab& color = at(pixel);
      if (!std::isnan(color.a)) continue;
      color = {};  // once, should it be drawn twice
      unknown.push_back(pixel);
    }
    if (!unknown.empty()) decode(unknown);
    std::vector<Ab> colors;
    for (const ViewPixel& pixel : pixels) colors.push_back(at(pixel));
    return colors;
  }

 private:
  static constexpr Ab kUnknown{std::numeric_limits<float>::quiet_NaN(), 0};
  void decode(std::span<const ViewPixel> pixels) {
    const std::vector<Ab> decoded = session_.model.decode(pixel_samples(session_.views(), pixels));
    for (std::size_t i = 0; i < pixels.size(); ++i) at(pixels[i]) = decoded[i];
  }
  Ab& at(const ViewPixel& pixel) { return colors_[pixel.view][pixel.pixel]; }

  const Session& session_;
  std::vector<std::vector<Ab>> colors_;
};

}  // namespace

void distill(Session& session) {
  const int steps = session.options.distill_steps;
  ColorFieldEngine& field = *session.model.chromaticity;
  DecodedColors colors(session);
  while (field.step_count() < steps) {
    const long step = field.step_count();
    const std::vector<ViewPixel> pixels = random_pixels(session, kPixels, std::uint64_t(step));
    if (pixels.empty()) break;
    session.loss = field.step(pixel_samples(session.views(), pixels), colors.of(pixels), {}, AbLoss::kHuber,
                              decayed_rate(kRate, kFinalRate, double(step) / steps));
    session.after_step("stage 2: colour for baking", "ab distance", step + 1, steps);
  }
}

double bake_ab_distance(const Session& session) {
  const PixelSamples pixels = pixel_samples(session.views(), random_pixels(session, kMeasuredPixels, kMeasuredStream));
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
