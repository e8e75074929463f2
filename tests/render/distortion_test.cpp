// The distortion of a ray: closed forms, and its derivative against finite differences.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "src/render/distortion_math.h"
#include "tests/support/finite_difference.h"

namespace cnerf {
namespace {

struct Sample {
  double t, dt;
};
const std::vector<Sample> kRay = {{0.4, 0.01}, {0.5, 0.01}, {0.7, 0.02}, {1.1, 0.02}, {1.9, 0.05}};

Distortion<double> distortion(const std::vector<double>& weights) {
  Distortion<double> sums;
  for (std::size_t i = 0; i < kRay.size(); ++i) sums.add(weights[i], {kRay[i].t, kRay[i].dt});
  return sums;
}

TEST(Distortion, IsTheDoubleSumOfItsDefinition) {
  const std::vector<double> weights = {0.1, 0.2, 0.05, 0.4, 0.15};
  double expected = 0;
  for (std::size_t i = 0; i < kRay.size(); ++i) {
    for (std::size_t j = 0; j < kRay.size(); ++j) {
      expected += weights[i] * weights[j] * std::abs(std::log(kRay[i].t / kRay[j].t));
    }
    expected += weights[i] * weights[i] * kRay[i].dt / kRay[i].t / 3;
  }
  EXPECT_NEAR(distortion(weights).value, expected, 1e-14);
}

TEST(Distortion, OfOneSurfaceIsItsThicknessAndOfTwoTheirDistance) {
  EXPECT_NEAR(distortion({0, 0, 1, 0, 0}).value, 0.02 / 0.7 / 3, 1e-14);
  const double apart = std::log(1.9 / 0.4);
  EXPECT_NEAR(distortion({0.5, 0, 0, 0, 0.5}).value, 0.5 * apart + 0.25 / 3 * (0.01 / 0.4 + 0.05 / 1.9), 1e-14);
}

TEST(Distortion, DoesNotDependOnTheScaleOfTheScene) {
  Distortion<double> near, far;
  for (const Sample& sample : kRay) {
    near.add(0.2, {sample.t, sample.dt});
    far.add(0.2, {3 * sample.t, 3 * sample.dt});
  }
  EXPECT_NEAR(near.value, far.value, 1e-14);
}

TEST(Distortion, DerivativeMatchesFiniteDifferencesAndEulersTheorem) {
  const std::vector<double> weights = {0.1, 0.2, 0.05, 0.4, 0.15};
  const Distortion<double> all = distortion(weights);
  const std::vector<double> numeric = test::central_difference(
      weights, {0, 1, 2, 3, 4}, 1e-6, [](const std::vector<double>& w) { return distortion(w).value; });
  Distortion<double> before;
  double sum = 0;
  for (std::size_t i = 0; i < kRay.size(); ++i) {
    const LogInterval<double> at(kRay[i].t, kRay[i].dt);
    const double derivative = distortion_derivative(weights[i], at, before.weight, before.moment, all);
    EXPECT_NEAR(derivative, numeric[i], 1e-8) << i;
    before.add(weights[i], at);
    sum += weights[i] * derivative;
  }
  EXPECT_NEAR(sum, 2 * all.value, 1e-13);
}

TEST(Distortion, TakesSamplesAtTheCamera) {
  const LogInterval<float> at(0.0f, 0.01f);
  EXPECT_TRUE(std::isfinite(at.place));
  EXPECT_TRUE(std::isfinite(at.extent));
}

}  // namespace
}  // namespace cnerf
