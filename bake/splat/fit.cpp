#include "bake/splat/fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/optim/adam.h"

namespace cnerf::bake {
namespace {

/// What a step of Adam changes at first.
constexpr float kPositionRate = 0.03f;  ///< of the splat's spacing
constexpr float kScaleRate = 0.015f;    ///< of ln
constexpr float kRotationRate = 0.01f;
constexpr float kOpacityRate = 0.04f;  ///< of the logit
constexpr float kColorRate = 0.006f;
constexpr float kShadingRate = 0.004f;
constexpr double kLastRate = 0.05;  ///< share of them in the end

constexpr float kOpacityWeight = 0.2f;  ///< of the loss by opacity beside that by a colour
constexpr double kFirstShare = 0.6;     ///< of all splats, placed before anything is drawn
/// When splats that show nothing go and others come where pictures differ most; share of all steps.
constexpr double kRenewals[] = {0.15, 0.3, 0.45};
constexpr float kLeastOpacity = 0.02f;  ///< that a splat is kept for
constexpr float kLeastShown = 0.02f;    ///< pixels of light in a picture that has something of the splat
constexpr float kMostStretch = 20;      ///< spacings that a splat's standard deviation may have
constexpr float kLeastStretch = 0.02f;

/// The step at which renewal r is due.
int renewal_step(const SplatOptions& options, std::size_t r) {
  return int(kRenewals[r] * options.steps);
}

void keep_in_range(Splat& splat, float spacing) {
  for (int c = 0; c < 3; ++c) splat.color[c] = std::clamp(splat.color[c], 0.0f, 1.0f);
  const float low = std::log(kLeastStretch * spacing), high = std::log(kMostStretch * spacing);
  for (int axis = 0; axis < 3; ++axis) splat.log_scale[axis] = std::clamp(splat.log_scale[axis], low, high);
  float square = 0;
  for (const float part : splat.rotation) square += part * part;
  for (float& part : splat.rotation) part /= std::sqrt(square);
}

}  // namespace

std::size_t splats_at_first(const SplatOptions& options) {
  return std::size_t(options.steps == 0 ? options.count : std::max(1.0, kFirstShare * options.count));
}
int splats_in_all(const SplatOptions& options, std::size_t placed) {
  return int(std::min(double(options.count), std::ceil(double(placed) / kFirstShare)));
}

SplatFit::SplatFit(std::span<const SplatTarget> targets, const std::vector<PlacedSplat>& placed,
                   const SplatOptions& options, double near)
    : targets_(targets), options_(options), near_(near) {
  CNERF_CHECK(!targets.empty(), "splats are fitted to pictures");
  for (const PlacedSplat& one : placed) {
    splats_.push_back(one.splat);
    spacing_.push_back(one.spacing);
  }
  first_moments_.resize(splats_.size());
  second_moments_.resize(splats_.size());
  last_shown_.resize(splats_.size(), 0);
}

const SplatTarget& SplatFit::target_of(int step) const {
  const auto round = std::size_t(step) / targets_.size(), place = std::size_t(step) % targets_.size();
  std::vector<std::uint32_t> order(targets_.size());
  std::iota(order.begin(), order.end(), 0u);
  SequentialRng rng(round, named_stream("pictures"));
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[rng.below(std::uint32_t(i))]);
  return targets_[order[place]];
}

double SplatFit::find_loss(const SplatTarget& target, const SplatPicture& picture) {
  d_picture_.width = picture.width;
  d_picture_.height = picture.height;
  d_picture_.rgb.resize(picture.rgb.size());
  d_picture_.opacity.resize(picture.opacity.size());
  const auto height = std::size_t(picture.height), width = std::size_t(picture.width);
  std::vector<double> of_row(height, 0);
  parallel_tasks(height, [&](std::size_t y) {
    for (std::size_t p = y * width; p < (y + 1) * width; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float off = picture.rgb[3 * p + c] - float(target.rgba[4 * p + c]) / 255;
        d_picture_.rgb[3 * p + c] = 2 * off;
        of_row[y] += double(off) * double(off);
      }
      d_picture_.opacity[p] = 2 * kOpacityWeight * (picture.opacity[p] - float(target.rgba[4 * p + 3]) / 255);
    }
  });
  return std::accumulate(of_row.begin(), of_row.end(), 0.0) / double(3 * width * height);
}

SplatFit::Row SplatFit::rates(std::size_t splat) const {
  Splat rates;
  const float position = kPositionRate * spacing_[splat];
  rates.position = {position, position, position};
  rates.log_scale = {kScaleRate, kScaleRate, kScaleRate};
  rates.rotation.fill(kRotationRate);
  rates.opacity_logit = kOpacityRate;
  rates.color = {kColorRate, kColorRate, kColorRate};
  rates.shading.fill(kShadingRate);
  return row_of(rates);
}

void SplatFit::update(const SplatGradients& gradients) {
  const float share = decayed_rate(1, kLastRate, double(done_) / options_.steps);
  const AdamStep step(share, done_ + 1);
  parallel_ranges(gradients.splats.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t splat = gradients.splats[i];
      if (gradients.weights[i] >= kLeastShown) last_shown_[splat] = done_;
      if (gradients.weights[i] <= 0) continue;  // hidden in this picture, which says nothing of it
      const Row d = row_of(gradients.gradients[i]), rate = rates(splat);
      Row values = row_of(splats_[splat]);
      for (std::size_t k = 0; k < d.size(); ++k) {
        step.at_rate(rate[k]).apply(d[k], first_moments_[splat][k], second_moments_[splat][k], values[k]);
      }
      splats_[splat] = splat_of(values);
      keep_in_range(splats_[splat], spacing_[splat]);
    }
  });
}

/// Pixels are drawn by their squared error, as many of each picture as give all new splats in a round.
void SplatFit::note_errors(const SplatTarget& target) {
  const std::size_t room = std::size_t(options_.count) - std::min(splats_.size(), std::size_t(options_.count));
  const std::size_t draws = room / targets_.size() + 1;
  std::vector<double> sums(target.pixels());
  double sum = 0;
  for (std::size_t p = 0; p < target.pixels(); ++p) {
    const float* d = &d_picture_.rgb[3 * p];
    if (target.depth[p] > 0) sum += double(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    sums[p] = sum;
  }
  if (sum <= 0) return;
  const CounterRng rng(std::uint64_t(done_), named_stream("errors"));
  std::size_t last = target.pixels();
  for (std::size_t i = 0; i < draws; ++i) {  // one of each stratum
    const double at = sum * (double(i) + double(rng.uniform(i))) / double(draws);
    const auto p = std::size_t(std::ranges::upper_bound(sums, at) - sums.begin());
    if (p >= target.pixels() || p == last) continue;
    last = p;
    const int width = target.intrinsics.width;
    const auto splat =
        splat_at_pixel(target, int(p) % width, int(p) / width, target.footprint(double(target.depth[p])));
    if (splat) wanted_.push_back(*splat);
  }
}

bool SplatFit::is_worth_keeping(std::size_t splat) const {
  // A little more than a round, for orders of rounds differ.
  return done_ - last_shown_[splat] <= int(targets_.size()) * 3 / 2 &&
         sigmoid(splats_[splat].opacity_logit) >= kLeastOpacity;
}

void SplatFit::renew() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < splats_.size(); ++i) {
    if (!is_worth_keeping(i)) continue;
    splats_[kept] = splats_[i];
    spacing_[kept] = spacing_[i];
    last_shown_[kept] = last_shown_[i];
    first_moments_[kept] = first_moments_[i];
    second_moments_[kept] = second_moments_[i];
    ++kept;
  }
  const std::size_t room = std::size_t(options_.count) - std::min(kept, std::size_t(options_.count));
  const std::size_t added = std::min(room, wanted_.size());
  splats_.resize(kept + added);
  spacing_.resize(kept + added);
  last_shown_.resize(kept);
  last_shown_.resize(kept + added, done_);
  first_moments_.resize(kept);
  second_moments_.resize(kept);
  first_moments_.resize(kept + added);
  second_moments_.resize(kept + added);
  for (std::size_t i = 0; i < added; ++i) {
    const PlacedSplat& wanted = wanted_[i * wanted_.size() / added];
    splats_[kept + i] = wanted.splat;
    spacing_[kept + i] = wanted.spacing;
  }
  wanted_.clear();
}

double SplatFit::step() {
  const SplatTarget& target = target_of(done_);
  const auto camera = splat_camera<float>(target.intrinsics, target.world_from_camera, near_, target.blur);
  const double error = find_loss(target, rasterizer_.draw(splats_, camera));
  update(rasterizer_.gradient(splats_, camera, d_picture_));
  const int round = int(targets_.size());
  for (std::size_t r = 0; r < std::size(kRenewals); ++r) {
    const int due = renewal_step(options_, r);
    if (done_ >= due - round && done_ < due) note_errors(target);
    if (done_ == due - 1 && due >= round) renew();
  }
  ++done_;
  return -10 * std::log10(std::max(error, 1e-12));
}

std::vector<Splat> SplatFit::result() const {
  std::vector<Splat> kept;
  for (std::size_t i = 0; i < splats_.size(); ++i) {
    if (is_worth_keeping(i)) kept.push_back(splats_[i]);
  }
  return kept;
}

}  // namespace cnerf::bake
