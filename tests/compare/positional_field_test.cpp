// The paper's own field: its maths against closed forms and finite differences in double, its engines against the
// contract that stage 1 and stage 2 rely on.

#include "src/compare/baselines/positional_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>

#include "src/color/colorspace_math.h"
#include "src/compare/baselines/torch/positional_math.h"
#include "src/compare/derived_engines.h"
#include "src/field/luminance_activation.h"
#include "src/render/composite_math.h"
#include "tests/compare/double_tensors.h"
#include "tests/support/finite_difference.h"
#include "tests/support/toy_capture.h"

namespace cnerf::compare {
namespace {

torch::Tensor tensor(const std::vector<double>& values, torch::IntArrayRef shape) {
  return torch::tensor(values, test::kDouble).view(shape);
}
torch::Tensor noise(torch::IntArrayRef shape, std::uint64_t seed) {
  return torch::rand(shape, torch::make_generator<torch::CPUGeneratorImpl>(seed), test::kDouble);
}

/// Worst relative error of autograd's gradient of a scalar function at `at`.
double gradient_error(const torch::Tensor& at, const std::function<torch::Tensor(const torch::Tensor&)>& f) {
  torch::Tensor leaf = at.clone().requires_grad_(true);
  f(leaf).backward();
  std::vector<std::size_t> all(std::size_t(at.numel()));
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  const auto scalar = [&](const std::vector<double>& values) { return f(tensor(values, at.sizes())).item<double>(); };
  return test::worst_relative_error(test::doubles(leaf.grad()),
                                    test::central_difference(test::doubles(at), all, 1e-6, scalar));
}

TEST(PositionalMath, EncodingIsSinesAndCosinesOfOctaves) {
  const std::vector<double> x = {-0.7, 0.1, 0.93};
  const std::vector<double> encoded = test::doubles(positional::encoding(tensor(x, {1, 3}), 4));
  ASSERT_EQ(encoded.size(), 27u);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_DOUBLE_EQ(encoded[c], x[c]);
    for (std::size_t k = 0; k < 4; ++k) {
      const double angle = std::pow(2.0, double(k)) * std::numbers::pi * x[c];
      EXPECT_NEAR(encoded[3 + 4 * c + k], std::sin(angle), 1e-14);
      EXPECT_NEAR(encoded[15 + 4 * c + k], std::cos(angle), 1e-14);
    }
  }
  const torch::Tensor upstream = noise({5, 27}, 3);
  EXPECT_LT(gradient_error(2 * noise({5, 3}, 4) - 1,
                           [&](const torch::Tensor& at) { return (positional::encoding(at, 4) * upstream).sum(); }),
            1e-7);  // measured 2e-9
}

TEST(PositionalMath, CompositingIsTheEngines) {
  constexpr std::int64_t kRays = 3, kSamples = 7;
  const torch::Tensor sigma = 4 * noise({kRays, kSamples}, 1), dt = 0.3 * noise({kRays, kSamples}, 2);
  const std::vector<double> s = test::doubles(sigma), d = test::doubles(dt),
                            v = test::doubles(noise({kRays, kSamples}, 5));
  const std::vector<double> ours = test::doubles(positional::weights(sigma, dt));
  torch::Tensor leaf = sigma.clone().requires_grad_(true);
  (positional::weights(leaf, dt) * tensor(v, {kRays, kSamples})).sum().backward();
  const std::vector<double> gradient = test::doubles(leaf.grad());
  for (std::size_t r = 0; r < kRays; ++r) {
    Compositor<double> all;
    for (std::size_t i = r * kSamples; i < (r + 1) * kSamples; ++i) {
      EXPECT_NEAR(ours[i], all.add(alpha_of(s[i], d[i]), v[i]), 1e-14);
    }
    Compositor<double> again;
    for (std::size_t i = r * kSamples; i < (r + 1) * kSamples; ++i) {
      again.add(alpha_of(s[i], d[i]), v[i]);
      EXPECT_NEAR(gradient[i], density_derivative(d[i], again.transmittance, v[i], all.value - again.value), 1e-13);
    }
  }
  EXPECT_LT(gradient_error(sigma,
                           [&](const torch::Tensor& at) {
                             return (positional::weights(at, dt) * tensor(v, {kRays, kSamples})).sum();
                           }),
            1e-6);
}

TEST(PositionalMath, ImportanceSamplesFollowTheWeights) {
  // Even weights: the identity, whatever the edges.
  const torch::Tensor edges = tensor({0, 1, 3, 4}, {1, 4});
  const torch::Tensor u = tensor({0, 1.0 / 6, 0.5, 1}, {1, 4});
  const std::vector<double> even =
      test::doubles(positional::inverse_transform(edges, torch::ones({1, 3}, test::kDouble), u));
  const double expected[] = {0, 0.5, 2, 4};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(even[i], expected[i], 1e-9);

  // As many samples in a bin as its weight says, spread evenly; nothing outside.
  const std::vector<double> weights = {0.1, 0, 0.6, 0.3};
  const torch::Tensor many = (torch::arange(10000, test::kDouble) + 0.5) / 10000;
  const std::vector<double> t = test::doubles(
      positional::inverse_transform(tensor({2, 3, 4, 4.5, 6}, {1, 5}), tensor(weights, {1, 4}), many.unsqueeze(0)));
  EXPECT_TRUE(std::ranges::is_sorted(t));
  const auto share = [&](double from, double to) {
    return double(std::ranges::count_if(t, [&](double at) { return at >= from && at < to; })) / 10000;
  };
  EXPECT_NEAR(share(2, 3), 0.1, 2e-4);  // 1e-5 is added to each weight
  EXPECT_NEAR(share(3, 4), 0, 2e-4);
  EXPECT_NEAR(share(4, 4.25), 0.3, 2e-4);
  EXPECT_NEAR(share(4.25, 4.5), 0.3, 2e-4);
  EXPECT_NEAR(share(4.5, 6), 0.3, 2e-4);

  // An empty ray is sampled evenly instead of dividing by nothing.
  const std::vector<double> nothing =
      test::doubles(positional::inverse_transform(edges, torch::zeros({1, 3}, test::kDouble), u));
  EXPECT_NEAR(nothing[2], 2, 1e-9);
}

TEST(PositionalMath, ActivationsAreTheEngines) {
  const std::vector<double> y = {0, 1e-4, 0.008, 0.01, 0.18, 1, 1.7};
  const std::vector<double> light = test::doubles(positional::lightness(tensor(y, {7})));
  for (std::size_t i = 0; i < y.size(); ++i) EXPECT_NEAR(light[i], lightness_from_luminance(y[i]), 1e-10);
  const std::vector<double> back = test::doubles(positional::luminance_of(tensor(light, {7})));
  for (std::size_t i = 0; i < y.size(); ++i) EXPECT_NEAR(back[i], y[i], 1e-12);
  const auto activation = LuminanceActivation<double>::up_to(1.0);
  for (const double raw : {-6.0, -1.0, 0.0, 2.5}) {
    EXPECT_NEAR(positional::emitted_luminance(tensor({raw}, {1}), activation.brightest).item<double>(),
                activation.value(raw), 1e-12);
    EXPECT_NEAR(positional::density(tensor({raw}, {1}), 4.0).item<double>(), density_from_raw(raw, 4.0), 1e-10);
  }
  EXPECT_LT(gradient_error(tensor({1e-3, 0.02, 0.4, 0.9}, {4}),
                           [](const torch::Tensor& at) { return positional::lightness(at).sum(); }),
            1e-6);
}

TEST(PositionalMath, ClassificationLossIsTheDivergence) {
  const torch::Tensor logits = 3 * noise({2, 6}, 8);
  const torch::Tensor bins = torch::tensor({0, 2, 3, 1, 4, 5, 4, 3, 2, 0}, torch::kInt64).view({2, 5});
  const torch::Tensor shares = tensor({0.4, 0.3, 0.2, 0.1, 0, 0.6, 0.4, 0, 0, 0}, {2, 5});
  const torch::Tensor weights = tensor({1, 0.5}, {2});
  const std::vector<double> p = test::doubles(torch::softmax(logits, 1)), z = test::doubles(shares);
  double expected = 0;
  for (std::size_t r = 0; r < 2; ++r) {
    for (std::size_t i = 0; i < 5; ++i) {
      const double share = z[5 * r + i];
      const auto bin = std::size_t(bins[std::int64_t(r)][std::int64_t(i)].item<std::int64_t>());
      if (share > 0) expected += (r == 0 ? 1 : 0.5) * share * std::log(share / p[6 * r + bin]) / 2;
    }
  }
  EXPECT_NEAR(positional::classification_loss(logits, bins, shares, weights).item<double>(), expected, 1e-12);
  EXPECT_LT(
      gradient_error(
          logits, [&](const torch::Tensor& at) { return positional::classification_loss(at, bins, shares, weights); }),
      1e-6);
}

/// The checker of gradients can fail.
TEST(PositionalMath, AWrongGradientIsNoticed) {
  const auto detached = [](const torch::Tensor& at) { return (at * at.detach()).sum(); };  // half of the true gradient
  EXPECT_GT(gradient_error(noise({4}, 1) + 0.5, detached), 0.3);
}

class PositionalField : public testing::Test {
 protected:
  static LuminanceEngineOptions options() {
    LuminanceEngineOptions options;
    options.samples_per_step = 192 * 8;
    options.occupancy.resolution = 16;
    options.seed = 5;
    return options;
  }
  PositionalField() { frame_.unit_per_world = 0.25; }

  [[nodiscard]] std::vector<TrainingView> views() const { return training_views(capture_, frame_); }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance() const {
    auto engine = engines_->make_luminance(options());
    engine->set_views(views());
    return engine;
  }
  [[nodiscard]] std::vector<Ray> rays() const {
    std::vector<Ray> rays;
    for (const TrainingView& view : views()) {
      for (int x = 2; x < 24; x += 5) rays.push_back(view.camera.ray({x + 0.5, 10.5}));
    }
    return rays;
  }
  [[nodiscard]] std::vector<RayResult> looked_at(const LuminanceEngine& engine) const {
    std::vector<RayResult> results(rays().size());
    engine.render(rays(), {}, {}, results);
    return results;
  }

  Capture capture_ = test::toy_capture(4, 24, 20);
  SceneFrame frame_;
  std::unique_ptr<Engines> engines_ = positional_engines(PositionalRays{});
};

TEST_F(PositionalField, Learns) {
  for (View& view : capture_.views) std::ranges::fill(view.image.u8, std::uint8_t(200));  // one grey wall all around
  const auto engine = make_luminance();
  std::vector<double> losses;
  for (int i = 0; i < 30; ++i) losses.push_back(engine->step(2e-3f).loss);
  const double first = std::accumulate(losses.begin(), losses.begin() + 6, 0.0);
  const double last = std::accumulate(losses.end() - 6, losses.end(), 0.0);
  EXPECT_LT(last, 0.3 * first);
  for (const RayResult& seen : looked_at(*engine)) {
    EXPECT_GE(seen.opacity, 0);
    EXPECT_LE(seen.opacity, 1.00001f);
  }
}

TEST_F(PositionalField, TheSkyIsBehindWhatItSees) {
  for (View& view : capture_.views) std::ranges::fill(view.image.u8, std::uint8_t(204));
  const std::vector<SkyLabel> labels(capture_.views.front().image.pixel_count(), SkyLabel::kEither);
  const auto first_step = [&](float light) {
    const DirectionMap sky{2, 1, {std::vector<float>(2, light)}};
    std::vector<TrainingView> outdoors = views();
    for (TrainingView& view : outdoors) {
      view.sky_labels = &labels;
      view.sky = &sky;
    }
    const auto engine = engines_->make_luminance(options());
    engine->set_views(outdoors);
    return engine->step(1e-3f);
  };
  // The net that it begins with is nowhere opaque, and a sky of the photographs' light is what it lacks.
  const StepReport black = first_step(0), alike = first_step(linear_from_srgb(0.8f));
  EXPECT_LT(alike.loss, black.loss);
  EXPECT_LT(alike.squared_error, black.squared_error);
}

TEST_F(PositionalField, ASnapshotContinuesAsIfNothingHadHappened) {
  const auto whole = make_luminance();
  for (int i = 0; i < 6; ++i) (void)whole->step(1e-3f);

  const auto first = make_luminance(), second = make_luminance();
  for (int i = 0; i < 3; ++i) (void)first->step(1e-3f);
  const std::vector<StatePiece> from = first->state(), to = second->state();
  ASSERT_EQ(from.size(), to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    ASSERT_EQ(from[i].name, to[i].name);
    ASSERT_EQ(from[i].bytes.size(), to[i].bytes.size());
    std::memcpy(to[i].bytes.data(), from[i].bytes.data(), from[i].bytes.size());
  }
  second->state_loaded();
  EXPECT_EQ(second->step_count(), 3);
  for (int i = 0; i < 3; ++i) (void)second->step(1e-3f);
  const auto a = looked_at(*whole), b = looked_at(*second);
  for (std::size_t r = 0; r < a.size(); ++r) EXPECT_NEAR(a[r].luminance, b[r].luminance, 1e-6);
}

TEST_F(PositionalField, TracesAreWhatRenderingSums) {
  const auto engine = make_luminance();
  for (int i = 0; i < 5; ++i) (void)engine->step(1e-3f);
  const auto seen = looked_at(*engine);
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine->trace(rays(), {}, {0, 1.0f}, samples, offsets);
  ASSERT_EQ(offsets.size(), seen.size() + 1);
  for (std::size_t r = 0; r < seen.size(); ++r) {
    float luminance = 0, opacity = 0, before = 0;
    std::vector<Vec3f> points, directions;
    for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
      EXPECT_GE(samples[s].t, before);
      before = samples[s].t;
      luminance += samples[s].weight * samples[s].luminance;
      opacity += samples[s].weight;
      points.push_back(rays()[r].at(samples[s].t));
      directions.push_back(rays()[r].direction);
    }
    EXPECT_NEAR(luminance, seen[r].luminance, 1e-5);
    EXPECT_NEAR(opacity, seen[r].opacity, 1e-5);
    std::vector<float> emitted(points.size());
    engine->query_luminance(points, directions, emitted);
    for (std::size_t s = 0; s < emitted.size(); ++s) EXPECT_NEAR(emitted[s], samples[offsets[r] + s].luminance, 1e-4);
  }
}

/// Two pixels; the first has two samples.
PixelSamples two_pixels() {
  PixelSamples pixels;
  pixels.positions = {{0.2f, 0.3f, 0.4f}, {0.8f, 0.1f, 0.5f}, {0.6f, 0.7f, 0.2f}};
  pixels.weights = {0.25f, 0.5f, 0.9f};
  pixels.luminance = {0.4f, 0.5f, 0.6f};
  pixels.offsets = {0, 2, 3};
  return pixels;
}

TEST_F(PositionalField, LogitsOfAPixelAreTheMeanOfItsSamples) {
  const auto engine = engines_->make_color_bins({}, 3);
  const PixelSamples pixels = two_pixels();
  std::vector<float> together(2 * kAbBinCount);
  engine->logits(pixels, together);
  std::vector<float> mean(kAbBinCount);
  for (std::size_t s = 0; s < 2; ++s) {
    PixelSamples alone;
    alone.positions = {pixels.positions[s]};
    alone.weights = {1.0f};
    alone.luminance = {0.5f};
    alone.offsets = {0, 1};
    std::vector<float> logits(kAbBinCount);
    engine->logits(alone, logits);
    for (std::size_t q = 0; q < logits.size(); ++q) mean[q] += pixels.weights[s] / 0.75f * logits[q];
  }
  for (std::size_t q = 0; q < mean.size(); ++q) EXPECT_NEAR(together[q], mean[q], 1e-5);
}

TEST_F(PositionalField, SpreadIsWhatTheLossGrowsByAndWhatTrainingLowers) {
  const std::vector<SoftLabel> labels = {soft_label({30, -20}), soft_label({-10, 40})};
  const auto loss = [&](float spread_weight) {
    return engines_->make_color_bins({}, 3)->step(two_pixels(), labels, {}, {spread_weight}, 1e-9f);
  };
  const double none = loss(0), once = loss(1), twice = loss(2);
  EXPECT_GT(once, none);
  EXPECT_NEAR(twice - none, 2 * (once - none), 1e-3 * (twice - none) + 1e-6);

  const auto spread_after = [&](float spread_weight) {
    const auto engine = engines_->make_color_bins({}, 3);
    for (int i = 0; i < 60; ++i) (void)engine->step(two_pixels(), labels, {}, {spread_weight}, 3e-3f);
    // Steps of next to nothing: what the loss grows by is the spread.
    const double without = engine->step(two_pixels(), labels, {}, {}, 1e-12f);
    return engine->step(two_pixels(), labels, {}, {.spread = 1}, 1e-12f) - without;
  };
  EXPECT_LT(spread_after(1), 0.5 * spread_after(0));
}

TEST_F(PositionalField, RegressionIsSmoothL1OfTheMean) {
  const std::vector<SoftLabel> labels = {soft_label({30, -20}), soft_label({-10, 40})};
  const auto loss = [&](float weight) {
    return engines_->make_color_bins({}, 3)->step(two_pixels(), labels, {}, {.regression = weight}, 1e-9f);
  };
  std::vector<Ab> means(2);
  engines_->make_color_bins({}, 3)->decode(two_pixels(), 1.0f, means);
  double expected = 0;
  for (std::size_t p = 0; p < means.size(); ++p) {
    const Ab wanted = mean_of(labels[p]);
    for (const double d : {std::abs(means[p].a - wanted.a), std::abs(means[p].b - wanted.b)}) {
      expected += (d < 10 ? d * d / 20 : d - 5) / 2;
    }
  }
  EXPECT_GT(expected, 1);
  EXPECT_NEAR(loss(1) - loss(0), expected, 1e-3 * expected);
}

TEST_F(PositionalField, LearnsColoursAndLeavesTheEncodingAlone) {
  const auto luminance = make_luminance();
  for (int i = 0; i < 5; ++i) (void)luminance->step(1e-3f);
  const auto before = looked_at(*luminance);
  const auto chroma = engines_->make_color_bins({}, 3);
  const std::vector<Ab> wanted = {{30, -20}, {-10, 40}};
  const std::vector<SoftLabel> labels = {soft_label(wanted[0]), soft_label(wanted[1])};
  for (int i = 0; i < 120; ++i) (void)chroma->step(two_pixels(), labels, {}, {}, 3e-3f);
  EXPECT_EQ(chroma->step_count(), 120);
  std::vector<Ab> colors(2);
  chroma->decode(two_pixels(), 0.38f, colors);
  for (std::size_t p = 0; p < 2; ++p) {
    EXPECT_NEAR(colors[p].a, wanted[p].a, 6);  // half a bin and the soft label's reach
    EXPECT_NEAR(colors[p].b, wanted[p].b, 6);
  }
  const auto after = looked_at(*luminance);
  for (std::size_t r = 0; r < before.size(); ++r) EXPECT_EQ(before[r].luminance, after[r].luminance);

  // Its encoding is that of the luminance field, and stays so.
  const auto bytes_of_encoding = [&](ColorBinEngine& engine) {
    const StatePiece values = engine.state().front();
    constexpr std::size_t kHead = 4 * (256 * 128 + 128 + 128 * 128 + 128 + 128 * 313 + 313);
    return std::vector<std::byte>(values.bytes.begin() + kHead, values.bytes.end());
  };
  const auto fresh = engines_->make_color_bins({}, 9);
  EXPECT_EQ(bytes_of_encoding(*fresh), bytes_of_encoding(*chroma));
  const auto other = positional_engines(PositionalRays{});
  EXPECT_NE(bytes_of_encoding(*other->make_color_bins({}, 9)), bytes_of_encoding(*fresh))
      << "without a luminance field it starts from random weights";

  // Also where colours stand on another geometry.
  const MixedEngines mixed(cpu_engines(), *engines_);
  EXPECT_EQ(bytes_of_encoding(*mixed.make_color_bins({}, 9)), bytes_of_encoding(*chroma));
}

TEST_F(PositionalField, RaysOfCapturesWithABoundAreSpreadInDisparity) {
  capture_.depth_range = DepthRange{2.0, 9.0};
  const PositionalRays rays = positional_rays(capture_, frame_);
  EXPECT_TRUE(rays.in_disparity);
  EXPECT_FLOAT_EQ(rays.near, 0.9f * 2.0f * 0.25f);
  capture_.depth_range.reset();
  EXPECT_FALSE(positional_rays(capture_, frame_).in_disparity);
  frame_.cascades = 3;
  EXPECT_GT(positional_rays(capture_, frame_).near, 0);

  // No sample lies nearer than that, and all lie in the box.
  const auto engine = positional_engines({0.3f, true})->make_luminance(options());
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine->trace(this->rays(), {}, {0, 1.0f}, samples, offsets);
  ASSERT_FALSE(samples.empty());
  for (const WeightedSample& sample : samples) EXPECT_GE(sample.t, 0.3f);
}

}  // namespace
}  // namespace cnerf::compare
