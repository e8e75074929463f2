#include "src/train/chroma/retouch.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/optim/adam.h"

namespace cnerf {
namespace {

constexpr std::size_t kLabelsPerPiece = 128;  // labels of a parallel piece of work

/// What the bins of a label decode to.
Ab annealed_mean(const SoftLabel& label, float temperature) {
  Ab mean;
  float total = 0;
  for (int i = 0; i < kSoftLabelBins; ++i) {
    const float weight = std::pow(label.weight[std::size_t(i)], 1 / temperature);
    const Ab centre = ab_bin_centres()[std::size_t(label.bin[std::size_t(i)])];
    mean.a += weight * centre.a;
    mean.b += weight * centre.b;
    total += weight;
  }
  return {mean.a / total, mean.b / total};
}

}  // namespace

SoftLabel label_decoded_to(Ab color, float temperature) {
  constexpr int kTries = 8;
  constexpr float kNearEnough = 0.1f;
  Ab aim = color;
  SoftLabel best = soft_label(color);
  if (temperature <= 0) return best;
  float least = std::numeric_limits<float>::infinity();
  for (int i = 0; i < kTries && least > kNearEnough; ++i) {
    const SoftLabel label = soft_label(aim);
    const Ab seen = annealed_mean(label, temperature);
    const float miss = std::hypot(color.a - seen.a, color.b - seen.b);
    if (miss < least) {
      least = miss;
      best = label;
    }
    aim = {aim.a + color.a - seen.a, aim.b + color.b - seen.b};
  }
  return best;
}

Retouch::Retouch(std::span<const CachedView> views, const KnownColorMap& known, const ColorModel* base,
                 ColorModel& model, const RetouchOptions& options)
    : views_(views), known_(known), base_(base), model_(model), options_(options) {}

double Retouch::step() {
  if (done_ == 0 && model_.sky.exists()) paint_sky();
  const CounterRng rng(options_.seed ^ named_stream("known"), std::uint64_t(done_));
  std::vector<ViewPixel> places = draw_kept();
  std::vector<Ab> colors(places.size());
  if (base_ != nullptr) colors = base_->decode(pixel_samples(views_, places));
  const auto known = known_.places();
  for (int i = 0; i < options_.known_pixels && !known.empty(); ++i) {
    const ViewPixel place = known[rng.below(std::uint64_t(i), std::uint32_t(known.size()))];
    places.push_back(place);
    colors.push_back(*known_.find(place.view, place.pixel));
  }
  const PixelSamples pixels = pixel_samples(views_, places);
  std::vector<float> weights;
  for (const ViewPixel& place : places) weights.push_back(views_[place.view].opacity[place.pixel]);
  std::vector<SoftLabel> labels(colors.size());
  parallel_each(colors.size(), kLabelsPerPiece, [&](std::size_t i) {
    labels[i] = label_decoded_to(colors[i], float(model_.options.decode_temperature));
  });

  const double share = double(done_) / options_.steps;
  const float rate = decayed_rate(options_.learning_rate, options_.final_learning_rate, share);
  const ChromaLossWeights more{float(model_.options.spread_weight), float(model_.options.regression_weight)};
  const double loss = model_.chroma->step(pixels, labels, weights, more, rate);
  model_.chromaticity->step(pixels, colors, weights, AbLoss::kHuber, rate / 2);
  if (!std::isfinite(loss)) throw DivergedError("colours: the loss is not finite; the take is as it was");
  ++done_;
  return loss;
}

void Retouch::paint_sky() {
  model_.sky = base_ != nullptr && base_->sky.exists() ? base_->sky : SkyColors::grey();
  model_.sky.add(views_, known_);
  model_.sky.refresh();
}

/// Random pixels of all views of which nothing is known.
std::vector<ViewPixel> Retouch::draw_kept() const {
  const CounterRng rng(options_.seed ^ named_stream("kept"), std::uint64_t(done_));
  std::vector<ViewPixel> kept;
  for (int i = 0; i < options_.kept_pixels; ++i) {
    const std::uint32_t v = rng.below(2 * std::uint64_t(i), std::uint32_t(views_.size()));
    const CachedView& view = views_[v];
    const std::uint32_t pixel = rng.below(2 * std::uint64_t(i) + 1, std::uint32_t(view.width * view.height));
    if (view.opacity[pixel] < kLeastColoredOpacity || known_.find(v, pixel) != nullptr) continue;
    kept.push_back({v, pixel});
  }
  return kept;
}

}  // namespace cnerf
