#include "src/field/luminance_activation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cnerf {
namespace {

TEST(LuminanceActivation, DerivativeIsThatOfTheValue) {
  for (const double brightest : {1.0, 7.5}) {
    const auto activation = LuminanceActivation<double>::up_to(brightest);
    for (double raw = -9; raw <= 9; raw += 0.37) {
      const double h = 1e-5, slope = (activation.value(raw + h) - activation.value(raw - h)) / (2 * h);
      EXPECT_NEAR(activation.derivative(raw), slope, 1e-6 * brightest) << raw;
    }
  }
}

TEST(LuminanceActivation, ReachesALittleBeyondTheBrightestAndDownToBlack) {
  const auto activation = LuminanceActivation<float>::up_to(1.0f);
  EXPECT_GT(activation.value(6), 1.0f);
  EXPECT_LE(activation.value(40), 1.06f);
  EXPECT_LT(activation.value(-12), 1e-6f);
  EXPECT_GE(activation.value(-40), 0.0f);
}

/// The loss compares L*: its gradient with respect to the raw output is that of a plain sigmoid however dark it gets,
/// so that what starts too bright or overshoots into black comes back.
TEST(LuminanceActivation, LightnessIsASigmoid) {
  const auto activation = LuminanceActivation<double>::up_to(1.0);
  for (double raw = -7; raw <= 7; raw += 0.5) {
    const double s = 1 / (1 + std::exp(-raw)), y = activation.value(raw);
    EXPECT_NEAR(lightness_from_luminance(y), activation.brightest * s, 1e-9);
    EXPECT_NEAR(lightness_derivative(y) * activation.derivative(raw), activation.brightest * s * (1 - s), 1e-6);
  }
}

}  // namespace
}  // namespace cnerf
