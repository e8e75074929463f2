#include "src/color/ab_bins.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "src/base/check.h"
#include "src/base/exp_of_negative.h"

namespace cnerf {
namespace {

/// Bins of one value of `a`: a run of `b` in steps of 10 (Zhang et al. 2016, Fig. 3a).
struct AbRow {
  int a, b_min, b_max;
};
constexpr std::array<AbRow, 20> kRows = {{
    {-90, 50, 90},   {-80, 20, 90},   {-70, 0, 90},   {-60, -20, 90}, {-50, -30, 100}, {-40, -40, 100}, {-30, -50, 100},
    {-20, -50, 100}, {-10, -60, 100}, {0, -70, 100},  {10, -80, 90},  {20, -80, 90},   {30, -90, 90},   {40, -100, 90},
    {50, -100, 80},  {60, -110, 80},  {70, -110, 80}, {80, -110, 70}, {90, -110, 70},  {100, -90, 0},
}};

std::array<Ab, kAbBinCount> make_centres() {
  std::array<Ab, kAbBinCount> centres;
  std::size_t next = 0;
  for (const AbRow& row : kRows) {
    for (int b = row.b_min; b <= row.b_max; b += 10) centres.at(next++) = {float(row.a), float(b)};
  }
  CNERF_CHECK_EQ(next, centres.size());
  return centres;
}

float squared_distance(Ab p, Ab q) {
  const float a = p.a - q.a;
  const float b = p.b - q.b;
  return a * a + b * b;
}

/// Which bins can be among the nearest of a colour, for each 10 x 10 cell of the ab plane.
class NearBins {
 public:
  NearBins() {
    std::iota(all_.begin(), all_.end(), 0);
    for (int i = 0; i < kCells * kCells; ++i) fill(i);
  }
  [[nodiscard]] std::span<const int> candidates(Ab color) const {
    // Cells are centred on grid points. Written so that NaN falls through to all bins.
    const float a = std::floor((color.a - kOrigin) / kAbGridStep);
    const float b = std::floor((color.b - kOrigin) / kAbGridStep);
    if (!(a >= 0 && b >= 0 && a < kCells && b < kCells)) return all_;
    return cells_[std::size_t(a) * kCells + std::size_t(b)];
  }

 private:
  static constexpr int kCells = 29;
  static constexpr float kOrigin = -145.0f;

  /// A bin is left out of a cell when five others are surely nearer: their farthest corner of the cell is nearer than
  /// its nearest point of the cell. The margin of 1e-3 covers rounding of colours at the border of a cell.
  void fill(int index) {
    const float half = kAbGridStep / 2;
    const int row = index / kCells, column = index % kCells;
    const Ab centre = {kOrigin + half + kAbGridStep * float(row), kOrigin + half + kAbGridStep * float(column)};
    std::array<float, kAbBinCount> nearest{};
    std::array<float, kAbBinCount> farthest{};
    for (std::size_t bin = 0; bin < kAbBinCount; ++bin) {
      const float a = std::abs(ab_bin_centres()[bin].a - centre.a);
      const float b = std::abs(ab_bin_centres()[bin].b - centre.b);
      nearest[bin] = std::hypot(std::max(a - half, 0.0f), std::max(b - half, 0.0f));
      farthest[bin] = std::hypot(a + half, b + half);
    }
    std::array<float, kAbBinCount> sorted = farthest;
    std::nth_element(sorted.begin(), sorted.begin() + (kSoftLabelBins - 1), sorted.end());
    const float limit = sorted[kSoftLabelBins - 1] + 1e-3f;
    for (std::size_t bin = 0; bin < kAbBinCount; ++bin) {
      if (nearest[bin] <= limit) cells_[std::size_t(index)].push_back(int(bin));
    }
  }

  std::array<int, kAbBinCount> all_{};
  std::array<std::vector<int>, kCells * kCells> cells_;
};

const NearBins& near_bins() {
  static const NearBins bins;
  return bins;
}

// The annealed mean is most of decoding a picture. It is written as eight sums side by side, which compilers turn into
// vector instructions of every processor.
constexpr std::size_t kPartials = 8, kPaddedBins = 320;
using Partial = std::array<float, kPartials>;

struct PaddedCentres {
  std::array<float, kPaddedBins> a{}, b{};
};

const PaddedCentres& padded_centres() {
  static const PaddedCentres centres = [] {
    PaddedCentres padded;
    for (std::size_t i = 0; i < kAbBinCount; ++i) {
      padded.a[i] = ab_bin_centres()[i].a;
      padded.b[i] = ab_bin_centres()[i].b;
    }
    return padded;
  }();
  return centres;
}

Partial first_of(const std::array<float, kPaddedBins>& values) {
  Partial first;
  std::copy_n(values.begin(), kPartials, first.begin());
  return first;
}

struct PaddedLogits {
  std::array<float, kPaddedBins> values;  ///< minus infinity behind the bins
  float most;
};

PaddedLogits padded_logits(std::span<const float> logits) {
  CNERF_CHECK_EQ(logits.size(), std::size_t(kAbBinCount));
  PaddedLogits padded;
  padded.values.fill(-std::numeric_limits<float>::infinity());
  std::ranges::copy(logits, padded.values.begin());
  Partial largest = first_of(padded.values);
  for (std::size_t first = kPartials; first < kPaddedBins; first += kPartials) {
    for (std::size_t i = 0; i < kPartials; ++i) largest[i] = std::max(largest[i], padded.values[first + i]);
  }
  padded.most = *std::ranges::max_element(largest);
  return padded;
}

double total_of(const Partial& sums) {
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

}  // namespace

const std::array<Ab, kAbBinCount>& ab_bin_centres() {
  static const std::array<Ab, kAbBinCount> centres = make_centres();
  return centres;
}

SoftLabel soft_label(Ab color) {
  SoftLabel label;
  std::array<float, kSoftLabelBins> distance;
  distance.fill(std::numeric_limits<float>::infinity());
  for (const int bin : near_bins().candidates(color)) {  // insertion into the five best, ties to the lower index
    const float d = squared_distance(color, ab_bin_centres()[std::size_t(bin)]);
    if (!(d < distance.back())) continue;
    std::size_t place = kSoftLabelBins - 1;
    for (; place > 0 && d < distance[place - 1]; --place) {
      distance[place] = distance[place - 1];
      label.bin[place] = label.bin[place - 1];
    }
    distance[place] = d;
    label.bin[place] = bin;
  }
  // Relative to the nearest bin, or a colour far outside the bins would have weights of 0 / 0.
  float sum = 0;
  for (std::size_t i = 0; i < kSoftLabelBins; ++i) {
    label.weight[i] = std::exp((distance[0] - distance[i]) / (2 * kSoftLabelSigma * kSoftLabelSigma));
    sum += label.weight[i];
  }
  for (float& weight : label.weight) weight /= sum;
  return label;
}

int nearest_bin(Ab color) {
  int best = 0;
  float best_distance = std::numeric_limits<float>::infinity();
  for (const int bin : near_bins().candidates(color)) {
    const float d = squared_distance(color, ab_bin_centres()[std::size_t(bin)]);
    if (d < best_distance) {
      best_distance = d;
      best = bin;
    }
  }
  return best;
}

Ab decode_arg_max(std::span<const float> logits) {
  CNERF_CHECK_EQ(logits.size(), std::size_t(kAbBinCount));
  return ab_bin_centres()[std::size_t(std::max_element(logits.begin(), logits.end()) - logits.begin())];
}

Ab decode_annealed_mean(std::span<const float> logits, float temperature) {
  CNERF_CHECK(temperature > 0, "the annealed mean needs a positive temperature");
  const auto [padded, most] = padded_logits(logits);
  const PaddedCentres& centres = padded_centres();
  Partial sum{}, a{}, b{};
  for (std::size_t first = 0; first < kPaddedBins; first += kPartials) {
    for (std::size_t i = 0; i < kPartials; ++i) {
      const float p = exp_of_negative(annealed_exponent(padded[first + i], most, temperature));
      sum[i] += p;
      a[i] += p * centres.a[first + i];
      b[i] += p * centres.b[first + i];
    }
  }
  const double total = total_of(sum);
  return {float(total_of(a) / total), float(total_of(b) / total)};
}

float inverse_perplexity(std::span<const float> logits) {
  constexpr float kLeastExponent = -5000;  // whose power is 0; 0 times minus infinity is not
  const auto [padded, most] = padded_logits(logits);
  Partial sum{}, weighted{};
  for (std::size_t first = 0; first < kPaddedBins; first += kPartials) {
    for (std::size_t i = 0; i < kPartials; ++i) {
      const float exponent = std::max(annealed_exponent(padded[first + i], most, 1.0f), kLeastExponent);
      const float p = exp_of_negative(exponent);
      sum[i] += p;
      weighted[i] += p * exponent;
    }
  }
  const double total = total_of(sum);
  return float(std::exp(total_of(weighted) / total) / total);
}

std::vector<float> rebalancing_weights(std::span<const float> prior, float lambda) {
  CNERF_CHECK_EQ(prior.size(), std::size_t(kAbBinCount));
  CNERF_CHECK(lambda >= 0 && lambda <= 1, "lambda mixes two distributions");
  std::vector<float> weights(prior.size());
  double expectation = 0;
  for (std::size_t i = 0; i < prior.size(); ++i) {
    weights[i] = 1.0f / ((1.0f - lambda) * prior[i] + lambda / float(kAbBinCount));
    expectation += double(prior[i]) * double(weights[i]);
  }
  for (float& weight : weights) weight = float(double(weight) / expectation);
  return weights;
}

}  // namespace cnerf
