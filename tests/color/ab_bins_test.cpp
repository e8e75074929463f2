#include "src/color/ab_bins.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "src/base/error.h"
#include "src/base/rng.h"
#include "src/capture/npy_reader.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

float squared_distance(Ab p, Ab q) {
  return (p.a - q.a) * (p.a - q.a) + (p.b - q.b) * (p.b - q.b);
}

/// All bins by distance, ties by index.
std::vector<int> sorted_bins(Ab color) {
  std::vector<int> order(kAbBinCount);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int p, int q) {
    return squared_distance(color, ab_bin_centres()[std::size_t(p)]) <
           squared_distance(color, ab_bin_centres()[std::size_t(q)]);
  });
  return order;
}

std::vector<Ab> probes() {
  SequentialRng rng(11, 0);
  std::vector<Ab> colors = {{0, 0},    {5, 5},   {-5, 5},     {15, -25}, {105, -95},
                            {-95, 95}, {200, 0}, {-500, 500}, {0, -145}};
  for (int i = 0; i < 20000; ++i) colors.push_back({rng.uniform(-150, 150), rng.uniform(-150, 150)});
  return colors;
}

TEST(AbBins, EqualTheReferenceFile) {
  CNERF_REQUIRE_DATA(file, "colorizer/pts_in_hull.npy");
  const NpyArray reference = read_npy(file);
  ASSERT_EQ(reference.shape, (std::vector<std::size_t>{kAbBinCount, 2}));
  for (std::size_t i = 0; i < kAbBinCount; ++i) {
    EXPECT_EQ(ab_bin_centres()[i].a, reference.values[2 * i]) << i;
    EXPECT_EQ(ab_bin_centres()[i].b, reference.values[2 * i + 1]) << i;
  }
}

TEST(AbBins, CentresAreTheirOwnNearestBin) {
  for (int i = 0; i < kAbBinCount; ++i) EXPECT_EQ(nearest_bin(ab_bin_centres()[std::size_t(i)]), i);
}

TEST(AbBins, NearestEqualsBruteForce) {
  for (const Ab color : probes()) ASSERT_EQ(nearest_bin(color), sorted_bins(color)[0]) << color.a << ' ' << color.b;
}

TEST(AbBins, SoftLabelsEqualBruteForceAndSumToOne) {
  for (const Ab color : probes()) {
    const SoftLabel label = soft_label(color);
    const std::vector<int> order = sorted_bins(color);
    double total = 0;
    for (int i = 0; i < kSoftLabelBins; ++i) {
      total += std::exp(-squared_distance(color, ab_bin_centres()[std::size_t(order[std::size_t(i)])]) / 50.0);
    }
    float sum = 0;
    for (std::size_t i = 0; i < kSoftLabelBins; ++i) {
      ASSERT_EQ(label.bin[i], order[i]) << color.a << ' ' << color.b << " place " << i;
      sum += label.weight[i];
      if (total < 1e-30) continue;  // far outside, the plain formula is 0 / 0
      const double plain = std::exp(-squared_distance(color, ab_bin_centres()[std::size_t(order[i])]) / 50.0) / total;
      ASSERT_NEAR(label.weight[i], plain, 2e-5);
    }
    ASSERT_NEAR(sum, 1, 1e-6);
  }
}

TEST(AbBins, SoftLabelOfACentreIsLedByIt) {
  const SoftLabel label = soft_label({20, 30});
  EXPECT_EQ(ab_bin_centres()[std::size_t(label.bin[0])].a, 20);
  EXPECT_EQ(ab_bin_centres()[std::size_t(label.bin[0])].b, 30);
  // Itself and four neighbours one step away: 1 / (1 + 4 exp(-100 / 50)).
  EXPECT_NEAR(label.weight[0], 1 / (1 + 4 * std::exp(-2.0)), 1e-6);
}

std::vector<float> logits_with_peaks() {
  std::vector<float> logits(kAbBinCount, -30.0f);
  logits[std::size_t(nearest_bin({50, 20}))] = 2.0f;
  logits[std::size_t(nearest_bin({-40, 10}))] = 1.0f;
  return logits;
}

TEST(AbBins, ArgMaxIgnoresScaleAndOffset) {
  std::vector<float> logits = logits_with_peaks();
  EXPECT_EQ(decode_arg_max(logits).a, 50);
  for (float& v : logits) v = 0.01f * v - 1000;
  EXPECT_EQ(decode_arg_max(logits).a, 50);
  EXPECT_EQ(decode_arg_max(logits).b, 20);
}

TEST(AbBins, AnnealedMeanRunsFromTheModeToTheMean) {
  const std::vector<float> logits = logits_with_peaks();
  const Ab mode = decode_annealed_mean(logits, 0.01f);
  EXPECT_NEAR(mode.a, 50, 1e-4);
  EXPECT_NEAR(mode.b, 20, 1e-4);
  const double p = 1 / (1 + std::exp(-1.0));
  const Ab mean = decode_annealed_mean(logits, 1.0f);
  EXPECT_NEAR(mean.a, 50 * p - 40 * (1 - p), 1e-3);
  EXPECT_NEAR(mean.b, 20 * p + 10 * (1 - p), 1e-3);
  const double sharper = 1 / (1 + std::exp(-1.0 / 0.38));
  EXPECT_NEAR(decode_annealed_mean(logits, 0.38f).a, 50 * sharper - 40 * (1 - sharper), 1e-3);
}

TEST(AbBins, AnnealedMeanOfHugeLogitsIsFinite) {
  std::vector<float> logits = logits_with_peaks();
  for (float& v : logits) v *= 1e6f;
  EXPECT_NEAR(decode_annealed_mean(logits, 0.38f).a, 50, 1e-4);
}

TEST(AbBins, ContractsAreChecked) {
  const std::vector<float> short_logits(312);
  EXPECT_THROW((void)decode_arg_max(short_logits), ContractError);
  EXPECT_THROW((void)decode_annealed_mean(logits_with_peaks(), 0.0f), ContractError);
  EXPECT_THROW((void)rebalancing_weights(short_logits, 0.5f), ContractError);
}

TEST(AbBins, InversePerplexityCountsEquallyLikelyBins) {
  std::vector<float> logits(kAbBinCount, 7.0f);
  EXPECT_NEAR(inverse_perplexity(logits), 1.0 / kAbBinCount, 1e-7);
  for (const std::size_t count : {1, 2, 20}) {
    std::ranges::fill(logits, -1e6f);
    std::fill_n(logits.begin() + 100, count, 3.0f);
    EXPECT_NEAR(inverse_perplexity(logits), 1.0 / double(count), 1e-6) << count;
  }
  std::ranges::fill(logits, -1e6f);
  logits[5] = std::log(0.9f);
  logits[6] = std::log(0.1f);
  EXPECT_NEAR(inverse_perplexity(logits), std::pow(0.9, 0.9) * std::pow(0.1, 0.1), 1e-6);
}

TEST(Rebalancing, UniformPriorGivesOnes) {
  for (const float w : rebalancing_weights(std::vector<float>(kAbBinCount, 1.0f / kAbBinCount), 0.5f)) {
    EXPECT_NEAR(w, 1, 1e-5);
  }
}

TEST(Rebalancing, WeightsOfTheImageNetPrior) {
  CNERF_REQUIRE_DATA(file, "colorizer/prior_probs.npy");
  const NpyArray reference = read_npy(file);
  const std::vector<float> prior(reference.values.begin(), reference.values.end());
  const std::vector<float> weights = rebalancing_weights(prior, 0.5f);
  const auto [smallest, largest] = std::minmax_element(weights.begin(), weights.end());
  EXPECT_NEAR(*smallest, 0.0965, 5e-5);
  EXPECT_NEAR(*largest, 6.1749, 5e-5);
  double expectation = 0;
  for (std::size_t i = 0; i < prior.size(); ++i) expectation += double(prior[i]) * double(weights[i]);
  EXPECT_NEAR(expectation, 1, 1e-6);
}

TEST(AbBins, AnnealedMeanEqualsTheFormulaInDouble) {
  SequentialRng rng(5, 0);
  for (int probe = 0; probe < 2000; ++probe) {
    std::vector<float> logits(kAbBinCount);
    const float spread = rng.uniform(0.1f, 40), temperature = rng.uniform(0.05f, 1.5f);
    for (float& logit : logits) logit = rng.uniform(-spread, spread);
    const double largest = *std::max_element(logits.begin(), logits.end());
    double sum = 0, a = 0, b = 0;
    for (std::size_t i = 0; i < logits.size(); ++i) {
      const double p = annealed_weight<double>(logits[i], largest, temperature);
      sum += p;
      a += p * double(ab_bin_centres()[i].a);
      b += p * double(ab_bin_centres()[i].b);
    }
    const Ab mean = decode_annealed_mean(logits, temperature);
    // Rounding of an exponent of up to 1600 in float; measured 4e-4.
    ASSERT_NEAR(mean.a, a / sum, 1e-3) << spread << ' ' << temperature;
    ASSERT_NEAR(mean.b, b / sum, 1e-3) << spread << ' ' << temperature;
  }
}

}  // namespace
}  // namespace cnerf
