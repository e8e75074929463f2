#include "src/train/chroma/distillation.h"

#include <algorithm>
#include <cmath>
#include <future>

#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/base/worker.h"
#include "src/optim/adam.h"

namespace cnerf {
namespace {

constexpr int kPixels = 8192;  // per step
constexpr int kMeasuredPixels = 4 * kPixels;
constexpr int kStepsAhead = 8;                     // whose pixels are found at the same time
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

/// What some steps learn from, but for its colours.
struct Draft {
  std::vector<std::vector<ViewPixel>> pixels;  ///< [steps]
  std::vector<PixelSamples> samples;           ///< [steps]
  std::vector<ViewPixel> fresh;                ///< drawn for the first time
  PixelSamples samples_of_fresh;
};

/// Drafts the next steps while the engine does those before.
class Drafts {
 public:
  Drafts(const Session& session, long first_step, long steps) : session_(session), next_(first_step), steps_(steps) {
    for (const CachedView& view : session.views()) is_known_.emplace_back(view.luminance.size(), false);
    begin_next();
  }
  /// Of the steps after those of the call before.
  [[nodiscard]] Draft next() {
    Draft draft = coming_.get();
    next_ += long(draft.pixels.size());
    begin_next();
    return draft;
  }

 private:
  void begin_next() {
    if (next_ < steps_) coming_ = worker_.submit([this, first = next_] { return drafted(first); });
  }
  [[nodiscard]] Draft drafted(long first) {
    Draft draft;
    draft.pixels.resize(std::size_t(std::min<long>(kStepsAhead, steps_ - first)));
    draft.samples.resize(draft.pixels.size());
    parallel_tasks(draft.pixels.size(), [&](std::size_t i) {
      draft.pixels[i] = random_pixels(session_, kPixels, std::uint64_t(first) + i);
      draft.samples[i] = pixel_samples(session_.views(), draft.pixels[i]);
    });
    for (const std::vector<ViewPixel>& of_step : draft.pixels) {
      for (const ViewPixel& pixel : of_step) {
        auto is_known = is_known_[pixel.view][pixel.pixel];
        if (!is_known) draft.fresh.push_back(pixel);
        is_known = true;
      }
    }
    draft.samples_of_fresh = pixel_samples(session_.views(), draft.fresh);
    return draft;
  }

  const Session& session_;
  long next_, steps_;
  std::vector<std::vector<bool>> is_known_;  // [views][pixels]
  std::future<Draft> coming_;
  Worker worker_;  // last: its jobs refer to what is above
};

/// Decoded colours of pixels. They stay the same all the time, and steps draw most pixels several times.
class DecodedColors {
 public:
  explicit DecodedColors(const Session& session) : session_(session) {
    for (const CachedView& view : session.views()) colors_.emplace_back(view.luminance.size());
  }
  /// What each step learns.  [steps][pixels]
  [[nodiscard]] std::vector<std::vector<Ab>> of(const Draft& draft) {
    std::vector<Ab> decoded;
    if (!draft.fresh.empty()) decoded = session_.model.decode(draft.samples_of_fresh);
    for (std::size_t i = 0; i < decoded.size(); ++i) colors_[draft.fresh[i].view][draft.fresh[i].pixel] = decoded[i];
    std::vector<std::vector<Ab>> colors(draft.pixels.size());
    parallel_tasks(colors.size(), [&](std::size_t step) {
      for (const ViewPixel& pixel : draft.pixels[step]) colors[step].push_back(colors_[pixel.view][pixel.pixel]);
    });
    return colors;
  }

 private:
  const Session& session_;
  std::vector<std::vector<Ab>> colors_;  // [views][pixels]; zero where no step has looked yet
};

}  // namespace

void distill(Session& session) {
  const long steps = session.options.distill_steps;
  ColorFieldEngine& field = *session.model.chromaticity;
  DecodedColors colors(session);
  Drafts drafts(session, field.step_count(), steps);
  while (field.step_count() < steps) {
    const Draft draft = drafts.next();
    const std::vector<std::vector<Ab>> wanted = colors.of(draft);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const float rate = decayed_rate(kRate, kFinalRate, double(field.step_count()) / double(steps));
      session.loss = field.step(draft.samples[i], wanted[i], {}, AbLoss::kHuber, rate);
      session.after_step("stage 2: colour for baking", "ab distance", field.step_count(), int(steps));
    }
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
