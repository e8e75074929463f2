#include "src/picture/joint_upsampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "src/base/error.h"
#include "src/base/rng.h"

namespace cnerf {
namespace {

constexpr float kDark = 30, kLight = 70;
constexpr Ab kRed = {60, 40}, kBlue = {10, -50};

/// Samples of a function of their column and row.
ChromaSamples samples_of(int width, int height, const std::function<void(int, int, Ab&, float&, float&)>& of) {
  ChromaSamples samples{width, height, {}, {}, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Ab ab;
      float lightness = 50, weight = 1;
      of(x, y, ab, lightness, weight);
      samples.ab.push_back(ab);
      samples.lightness.push_back(lightness);
      samples.weight.push_back(weight);
    }
  }
  return samples;
}

float distance(Ab one, Ab other) {
  return std::hypot(one.a - other.a, one.b - other.b);
}

/// A photograph 8 times as large, dark and red to the left of an edge through the middle of the samples' column 8,
/// light and blue to the right of it. That column has the mean of both in lightness and chroma, as the mean of an area.
constexpr int kScale = 8, kEdgeColumn = 8, kEdge = kEdgeColumn * kScale + kScale / 2;

ChromaSamples step_edge() {
  return samples_of(16, 12, [](int x, int, Ab& ab, float& lightness, float&) {
    const float share = x < kEdgeColumn ? 0.0f : x > kEdgeColumn ? 1.0f : 0.5f;
    ab = {kRed.a + share * (kBlue.a - kRed.a), kRed.b + share * (kBlue.b - kRed.b)};
    lightness = kDark + share * (kLight - kDark);
  });
}

TEST(JointUpsampling, AnEdgeInLightnessIsOneInChroma) {
  const JointUpsampler upsampler(step_edge(), 16 * kScale, 12 * kScale);
  for (int y = 0; y < 12 * kScale; ++y) {
    for (int x = 0; x < 16 * kScale; ++x) {
      const bool is_left = x < kEdge;
      // Of the distance of 103 between both; measured 0.30, which the mixed column lends to its own pixels.
      EXPECT_LT(distance(upsampler.at(x, y, is_left ? kDark : kLight), is_left ? kRed : kBlue), 0.5f) << x << " " << y;
    }
  }
}

/// What the bound above means: without an edge in lightness chroma runs across it.
TEST(JointUpsampling, WithoutAnEdgeInLightnessChromaIsSmooth) {
  ChromaSamples samples = step_edge();
  samples.lightness.assign(samples.lightness.size(), 50.0f);
  const JointUpsampler upsampler(samples, 16 * kScale, 12 * kScale);
  EXPECT_GT(distance(upsampler.at(kEdge - 1, 40, 50), kRed), 40);
  float largest_step = 0;
  for (int x = 1; x < 16 * kScale; ++x) {
    largest_step = std::max(largest_step, distance(upsampler.at(x, 40, 50), upsampler.at(x - 1, 40, 50)));
  }
  EXPECT_LT(largest_step, 103.0f / kScale) << "no seams";
}

TEST(JointUpsampling, ConstantChromaStaysConstant) {
  const CounterRng rng(3, 1);
  const ChromaSamples samples = samples_of(9, 7, [&](int x, int y, Ab& ab, float& lightness, float& weight) {
    ab = kRed;
    lightness = 100 * rng.uniform(std::uint64_t(x + 9 * y));
    weight = 0.01f + rng.uniform(std::uint64_t(1000 + x + 9 * y));
  });
  const JointUpsampler upsampler(samples, 31, 40);  // by other factors across and down
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 31; ++x) {
      // Rounding of sums of 64 numbers.
      EXPECT_LT(distance(upsampler.at(x, y, 100 * rng.uniform(std::uint64_t(5000 + x + 31 * y))), kRed), 1e-3f);
    }
  }
}

TEST(JointUpsampling, AtTheirOwnSizeSamplesAreTheChroma) {
  const ChromaSamples samples = step_edge();
  const JointUpsampler upsampler(samples, 16, 12);
  for (int i = 0; i < 16 * 12; ++i) {
    const Ab chroma = upsampler.at(i % 16, i / 16, 12.0f);
    EXPECT_EQ(chroma.a, samples.ab[std::size_t(i)].a);
    EXPECT_EQ(chroma.b, samples.ab[std::size_t(i)].b);
  }
}

/// The formula of the head of the file, written anew in double precision.
TEST(JointUpsampling, IsTheWeightedMeanOfSamplesInReach) {
  const CounterRng rng(7, 1);
  const ChromaSamples samples = samples_of(10, 8, [&](int x, int y, Ab& ab, float& lightness, float& weight) {
    const auto at = std::uint64_t(x + 10 * y);
    ab = {100 * rng.uniform(at) - 50, 100 * rng.uniform(at + 100) - 50};
    lightness = 100 * rng.uniform(at + 200);
    weight = rng.uniform(at + 300);
  });
  const int width = 53, height = 61;
  const JointUpsampler upsampler(samples, width, height);
  const auto near = [](double d) { return std::abs(d) < 4 ? std::pow(1 - d * d / 16, 3) : 0.0; };
  for (int pixel = 0; pixel < width * height; pixel += 7) {
    const int column = pixel % width, row = pixel / width;
    const float lightness = 100 * rng.uniform(std::uint64_t(pixel) + 400);
    double total = 0, a = 0, b = 0;
    for (int i = 0; i < 80; ++i) {
      const double across = (column + 0.5) * 10 / width - (i % 10 + 0.5);
      const double down = (row + 0.5) * 8 / height - (i / 10 + 0.5);
      const double relative = (samples.lightness[std::size_t(i)] - lightness) / 6.0;
      const double weight =
          near(across) * near(down) * std::pow(1 + relative * relative, -2) * samples.weight[std::size_t(i)];
      total += weight;
      a += weight * samples.ab[std::size_t(i)].a;
      b += weight * samples.ab[std::size_t(i)].b;
    }
    const Ab chroma = upsampler.at(column, row, lightness);
    EXPECT_NEAR(chroma.a, a / total, 1e-3);
    EXPECT_NEAR(chroma.b, b / total, 1e-3);
  }
}

TEST(JointUpsampling, WhatIsTransparentDoesNotBleed) {
  const ChromaSamples samples = samples_of(16, 12, [](int x, int, Ab& ab, float&, float& weight) {
    ab = x < 8 ? kRed : kBlue;
    weight = x < 8 ? 1.0f : 0.0f;
  });
  const JointUpsampler upsampler(samples, 16 * kScale, 12 * kScale);
  for (int x = 0; x < 10 * kScale; ++x) EXPECT_LT(distance(upsampler.at(x, 50, 50), kRed), 1e-3f) << x;
  EXPECT_EQ(distance(upsampler.at(13 * kScale, 50, 50), {}), 0) << "nothing is near that has a colour";
}

TEST(JointUpsampling, PlanesOfAnotherSizeAreRefused) {
  ChromaSamples samples = step_edge();
  samples.weight.pop_back();
  EXPECT_THROW(JointUpsampler(samples, 100, 100), ContractError);
}

}  // namespace
}  // namespace cnerf
