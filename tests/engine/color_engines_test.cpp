#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>

#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "src/engine/color_engines.h"
#include "tests/support/engine_state.h"
#include "tests/support/isa.h"

namespace cnerf {
namespace {

HashGridOptions small_grid() {
  return {.levels = 3, .log2_rows = 10, .coarsest_resolution = 4, .finest_resolution = 32};
}

/// Pixels with two samples each; pixel p lies at x = (p + 0.5) / n.
PixelSamples row_of_pixels(int n, float opacity = 0.9f) {
  PixelSamples pixels;
  for (int p = 0; p < n; ++p) {
    const float x = (float(p) + 0.5f) / float(n);
    pixels.positions.push_back({x, 0.3f, 0.5f});
    pixels.positions.push_back({x, 0.7f, 0.5f});
    pixels.weights.push_back(0.75f * opacity);
    pixels.weights.push_back(0.25f * opacity);
    pixels.luminance.push_back(0.4f);
    pixels.luminance.push_back(0.2f);
    pixels.offsets.push_back(pixels.positions.size());
  }
  return pixels;
}

PixelSamples single_samples(const PixelSamples& pixels) {
  PixelSamples split;
  for (std::size_t s = 0; s < pixels.positions.size(); ++s) {
    split.positions.push_back(pixels.positions[s]);
    split.weights.push_back(1.0f);
    split.luminance.push_back(pixels.luminance[s]);
    split.offsets.push_back(s + 1);
  }
  return split;
}

std::vector<SoftLabel> two_halves(int n) {
  std::vector<SoftLabel> labels;
  for (int p = 0; p < n; ++p) labels.push_back(soft_label(p < n / 2 ? Ab{50, 30} : Ab{-30, -20}));
  return labels;
}

TEST(ColorBinEngine, CompositingFeaturesEqualsCompositingLogits) {
  const auto engine = make_cpu_color_bin_engine(small_grid(), 3);
  const PixelSamples pixels = row_of_pixels(40);
  for (int i = 0; i < 20; ++i) engine->step(pixels, two_halves(40), {}, {}, 1e-2f);

  std::vector<float> composited(40 * kAbBinCount), of_samples(80 * kAbBinCount);
  engine->logits(pixels, composited);
  engine->logits(single_samples(pixels), of_samples);
  for (int p = 0; p < 40; ++p) {
    for (int q = 0; q < kAbBinCount; ++q) {
      const float expected =
          0.75f * of_samples[(2 * p) * kAbBinCount + q] + 0.25f * of_samples[(2 * p + 1) * kAbBinCount + q];
      EXPECT_NEAR(composited[p * kAbBinCount + q], expected, 1e-3f * (1 + std::abs(expected)));
    }
  }
}

TEST(ColorBinEngine, LearnsTwoColours) {
  const auto engine = make_cpu_color_bin_engine(small_grid(), 3);
  const PixelSamples pixels = row_of_pixels(64);
  const double first = engine->step(pixels, two_halves(64), {}, {}, 1e-2f);
  EXPECT_NEAR(first, std::log(double(kAbBinCount)), 1.5);  // nearly uniform, less the label's own entropy
  double last = first;
  for (int i = 0; i < 150; ++i) last = engine->step(pixels, two_halves(64), {}, {}, 1e-2f);
  EXPECT_LT(last, 0.2);
  std::vector<float> logits(64 * kAbBinCount);
  engine->logits(pixels, logits);
  EXPECT_EQ(decode_arg_max(std::span(logits).first(kAbBinCount)).a, 50);
  EXPECT_EQ(decode_arg_max(std::span(logits).last(kAbBinCount)).a, -30);
}

/// The engine's parameters and, after a step from zero moments, their gradient.
struct Parameters {
  std::span<float> values;
  std::vector<float> gradient;
};
std::vector<Parameters> parameters_of(ColorBinEngine& engine) {
  const std::vector<StatePiece> state = engine.state();
  std::vector<Parameters> parameters;
  parameters.push_back(
      {test::floats_of(state, "features.grid.table"), test::gradient_in(state, "features.grid.moments")});
  for (const char* net : {"features.net", "head"}) {
    parameters.push_back({test::floats_of(state, std::string(net) + ".weights"),
                          test::gradient_in(state, std::string(net) + ".first_moments")});
  }
  return parameters;
}

TEST(ColorBinEngine, GradientIsTheLossesDerivativeAndThatOfWhatIsAdded) {
  const test::ScopedIsa floats(test::best_float_isa());
  const PixelSamples pixels = row_of_pixels(48);
  for (const ChromaLossWeights more : {ChromaLossWeights{}, {.spread = 30}, {.regression = 1}, {3, 0.1f}}) {
    const auto engine = make_cpu_color_bin_engine(small_grid(), 5);
    for (int i = 0; i < 20; ++i) engine->step(pixels, two_halves(48), {}, {}, 1e-2f);
    test::forget_moments(*engine);
    const auto loss = [&] {
      engine->state_loaded();
      return engine->step(pixels, two_halves(48), {}, more, 1e-12f);
    };
    loss();
    const std::vector<Parameters> parameters = parameters_of(*engine);
    ASSERT_EQ(parameters.size(), 3u) << "grid, net and head";
    for (const Parameters& p : parameters) {
      ASSERT_EQ(p.values.size(), p.gradient.size());
      double slope = 0;  // along the gradient, per unit of its length
      for (const float g : p.gradient) slope += double(g) * g;
      slope = std::sqrt(slope);
      const std::vector<float> kept(p.values.begin(), p.values.end());
      const auto loss_at = [&](double distance) {
        for (std::size_t i = 0; i < kept.size(); ++i) p.values[i] = kept[i] + float(distance * p.gradient[i] / slope);
        const double result = loss();
        std::ranges::copy(kept, p.values.begin());
        return result;
      };
      constexpr double kStep = 1e-3;
      EXPECT_NEAR((loss_at(kStep) - loss_at(-kStep)) / (2 * kStep), slope, 0.02 * slope)
          << more.spread << ' ' << more.regression;
    }
  }
}

TEST(ColorBinEngine, RegressionIsSmoothL1OfTheMean) {
  const PixelSamples pixels = row_of_pixels(48);
  const std::vector<SoftLabel> labels = two_halves(48);
  const auto loss = [&](float weight) {
    return make_cpu_color_bin_engine(small_grid(), 5)->step(pixels, labels, {}, {.regression = weight}, 1e-9f);
  };
  std::vector<Ab> means(pixels.pixels());
  make_cpu_color_bin_engine(small_grid(), 5)->decode(pixels, 1.0f, means);
  double expected = 0;
  for (std::size_t p = 0; p < means.size(); ++p) {
    const Ab wanted = mean_of(labels[p]);
    for (const double d : {std::abs(means[p].a - wanted.a), std::abs(means[p].b - wanted.b)}) {
      expected += (d < 10 ? d * d / 20 : d - 5) / double(means.size());
    }
  }
  EXPECT_GT(expected, 1);
  EXPECT_NEAR(loss(1) - loss(0), expected, 1e-3 * expected);
}

TEST(ColorBinEngine, SpreadIsWhatTheLossGrowsBy) {
  const PixelSamples pixels = row_of_pixels(48);
  const auto loss = [&](const PixelSamples& of, float spread_weight) {
    return make_cpu_color_bin_engine(small_grid(), 5)
        ->step(of, two_halves(int(of.pixels())), {}, {spread_weight}, 1e-9f);
  };
  const double none = loss(pixels, 0), once = loss(pixels, 1), twice = loss(pixels, 2);
  EXPECT_GT(once, none);
  EXPECT_NEAR(twice - none, 2 * (once - none), 1e-6);
  EXPECT_NEAR(loss(single_samples(pixels), 100), loss(single_samples(pixels), 0), 1e-5) << "one sample has no spread";
}

TEST(ColorBinEngine, SpreadMakesTheSamplesOfAPixelAgree) {
  const PixelSamples pixels = row_of_pixels(64), samples = single_samples(pixels);
  const auto disagreement = [&](float spread_weight) {
    const auto engine = make_cpu_color_bin_engine(small_grid(), 3);
    double last = 0;
    for (int i = 0; i < 150; ++i) last = engine->step(pixels, two_halves(64), {}, {spread_weight}, 1e-2f);
    EXPECT_LT(last, 0.3) << "what is wanted is still learnt";
    std::vector<Ab> colors(samples.pixels());
    engine->decode(samples, 1.0f, colors);
    double total = 0;
    for (std::size_t s = 0; s < colors.size(); s += 2) {
      total += std::hypot(colors[s].a - colors[s + 1].a, colors[s].b - colors[s + 1].b);
    }
    return total / double(pixels.pixels());
  };
  EXPECT_LT(disagreement(1.0f), 0.5 * disagreement(0));
}

TEST(ColorBinEngine, StepsAreBitEqualForAnyNumberOfThreads) {
  std::vector<double> losses;
  for (const int threads : {1, 2, 4}) {
    set_thread_count(threads);
    const auto engine = make_cpu_color_bin_engine(small_grid(), 3);
    double loss = 0;
    for (int i = 0; i < 20; ++i) loss = engine->step(row_of_pixels(300), two_halves(300), {}, {}, 1e-2f);
    losses.push_back(loss);
  }
  set_thread_count(0);
  EXPECT_EQ(losses[0], losses[1]);
  EXPECT_EQ(losses[0], losses[2]);
}

TEST(ColorFieldEngine, StartsGreyAndReachesTheTargets) {
  const auto engine = make_cpu_color_field_engine(small_grid(), 3);
  const PixelSamples pixels = row_of_pixels(64);
  std::vector<Ab> seen(64), targets;
  engine->composite(pixels, seen);
  for (const Ab& color : seen) EXPECT_NEAR(std::hypot(color.a, color.b), 0, 0.5);

  for (int p = 0; p < 64; ++p) targets.push_back({40.0f - float(p), float(p % 8)});
  double distance = 0;
  for (int i = 0; i < 600; ++i) distance = engine->step(pixels, targets, {}, AbLoss::kHuber, i < 300 ? 1e-2f : 1e-3f);
  EXPECT_LT(distance, 1.0);
  engine->composite(pixels, seen);
  for (int p = 0; p < 64; ++p) EXPECT_NEAR(std::hypot(seen[p].a - targets[p].a, seen[p].b - targets[p].b), 0, 4.0);
}

/// The contract of the bake: compositing the samples' XYZ in linear light gives the pixel's ab and its luminance.
/// Two answers of three say one colour, the third says another: the photometric loss takes their mean, Huber's stays
/// with the majority.
TEST(ColorFieldEngine, SquaredLossTakesTheMeanAndHubersTheMajority) {
  const Ab often{30, 10}, seldom{-30, -10};
  const PixelSamples pixels = row_of_pixels(12);
  const auto learnt = [&](AbLoss loss) {
    const auto engine = make_cpu_color_field_engine(small_grid(), 5);
    for (int i = 0; i < 600; ++i) {
      const std::vector<Ab> targets(12, i % 3 == 2 ? seldom : often);
      engine->step(pixels, targets, {}, loss, i < 400 ? 1e-2f : 1e-3f);
    }
    std::vector<Ab> colors(12);
    engine->composite(pixels, colors);
    return colors;
  };
  const std::vector<Ab> mean = learnt(AbLoss::kSquared), majority = learnt(AbLoss::kHuber);
  for (int p = 0; p < 12; ++p) {
    EXPECT_NEAR(mean[p].a, (2 * often.a + seldom.a) / 3, 5);
    EXPECT_NEAR(majority[p].a, often.a, 5);
  }
}

TEST(ColorFieldEngine, APixelWithoutWeightDoesNotCount) {
  const PixelSamples pixels = row_of_pixels(2);
  const auto engine = make_cpu_color_field_engine(small_grid(), 5);
  const std::vector<float> weights = {1, 0};
  for (int i = 0; i < 200; ++i) engine->step(pixels, std::vector<Ab>(2, {30, 10}), weights, AbLoss::kSquared, 1e-2f);
  const auto unweighted = make_cpu_color_field_engine(small_grid(), 5);
  PixelSamples first = row_of_pixels(2);
  first.offsets.resize(2);
  first.positions.resize(2);
  first.weights.resize(2);
  first.luminance.resize(2);
  for (int i = 0; i < 200; ++i) unweighted->step(first, std::vector<Ab>(1, {30, 10}), {}, AbLoss::kSquared, 1e-2f);
  std::vector<Ab> with(2), without(2);
  engine->composite(pixels, with);
  unweighted->composite(pixels, without);
  for (int p = 0; p < 2; ++p) EXPECT_NEAR(with[p].a, without[p].a, 1.0) << p;
}

TEST(ColorFieldEngine, PixelColourIsTheCompositeOfTheSamplesLight) {
  const auto engine = make_cpu_color_field_engine(small_grid(), 3);
  const PixelSamples pixels = row_of_pixels(16);
  const std::vector<Ab> targets(16, Ab{30, -25});
  for (int i = 0; i < 100; ++i) engine->step(pixels, targets, {}, AbLoss::kHuber, 1e-2f);
  std::vector<Chromaticity> chromaticity(pixels.positions.size());
  engine->query(pixels.positions, chromaticity);
  std::vector<Ab> seen(16);
  engine->composite(pixels, seen);
  for (std::size_t p = 0; p < 16; ++p) {
    Vec3d light{};
    for (std::size_t s = pixels.offsets[p]; s < pixels.offsets[p + 1]; ++s) {
      const double y = double(pixels.weights[s]) * pixels.luminance[s];
      light += linear_rgb_from_relative_xyz(Vec3d{y * chromaticity[s].x, y, y * chromaticity[s].z});
    }
    const Lab<double> lab = lab_from_linear_rgb(light);
    EXPECT_NEAR(lab.a, seen[p].a, 1e-2);
    EXPECT_NEAR(lab.b, seen[p].b, 1e-2);
  }
}

}  // namespace
}  // namespace cnerf
