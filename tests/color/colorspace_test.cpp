#include "src/color/colorspace_math.h"

#include <gtest/gtest.h>

#include "src/base/rng.h"

namespace cnerf {
namespace {

void expect_lab(Lab<float> lab, double lightness, double a, double b) {
  // The reference values were printed with a matrix of four digits; the exact one moves them by up to 0.01.
  EXPECT_NEAR(lab.lightness, lightness, 0.01);
  EXPECT_NEAR(lab.a, a, 0.01);
  EXPECT_NEAR(lab.b, b, 0.01);
}

TEST(Colorspace, PrimariesHaveTheirLabValues) {
  expect_lab(lab_from_linear_rgb<float>({1, 0, 0}), 53.241, 80.094, 67.203);
  expect_lab(lab_from_linear_rgb<float>({0, 1, 0}), 87.738, -86.188, 83.172);
  expect_lab(lab_from_linear_rgb<float>({0, 0, 1}), 32.294, 79.188, -107.859);
}

template <typename Real>
class ColorspaceReal : public testing::Test {};
using Reals = testing::Types<float, double>;
TYPED_TEST_SUITE(ColorspaceReal, Reals);

TYPED_TEST(ColorspaceReal, GreyHasNoChromaAtAll) {
  for (int i = 0; i <= 4096; ++i) {
    const TypeParam v = TypeParam(i) / TypeParam(4093);
    const Lab<TypeParam> lab = lab_from_linear_rgb<TypeParam>({v, v, v});
    ASSERT_EQ(lab.a, 0) << v;
    ASSERT_EQ(lab.b, 0) << v;
    ASSERT_EQ(luminance_of<TypeParam>({v, v, v}), v);
  }
}

TYPED_TEST(ColorspaceReal, NoChromaGivesThreeEqualChannels) {
  for (int i = 0; i <= 1000; ++i) {
    const Vec3<TypeParam> rgb = linear_rgb_from_lab<TypeParam>({TypeParam(i) / 10, 0, 0});
    ASSERT_EQ(rgb.x, rgb.y);
    ASSERT_EQ(rgb.y, rgb.z);
  }
}

TYPED_TEST(ColorspaceReal, WhiteAndBlackAreTheEnds) {
  EXPECT_NEAR(lightness_from_luminance(TypeParam(1)), 100, 1e-4);
  EXPECT_NEAR(lightness_from_luminance(TypeParam(0)), 0, 1e-4);
}

TEST(Colorspace, MatrixMapsWhiteAndPrimariesToTheirChromaticities) {
  constexpr double kWhite[3] = {0.95047, 1, 1.08883};
  constexpr double kXy[3][2] = {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}};
  for (int channel = 0; channel < 3; ++channel) {
    Vec3d rgb;
    rgb[channel] = 1;
    Vec3d xyz = relative_xyz_from_linear_rgb(rgb);
    for (int i = 0; i < 3; ++i) xyz[i] *= kWhite[i];
    const double sum = xyz.x + xyz.y + xyz.z;
    EXPECT_NEAR(xyz.x / sum, kXy[channel][0], 1e-14);
    EXPECT_NEAR(xyz.y / sum, kXy[channel][1], 1e-14);
  }
}

TEST(Colorspace, XyzRoundTripInDouble) {
  SequentialRng rng(1, 1);
  for (int i = 0; i < 1000; ++i) {
    const Vec3d rgb = {rng.uniform(), rng.uniform(), rng.uniform()};
    const Vec3d back = linear_rgb_from_relative_xyz(relative_xyz_from_linear_rgb(rgb));
    ASSERT_LT(length(back - rgb), 1e-14);
  }
}

TEST(Colorspace, LabRoundTripInDouble) {
  SequentialRng rng(2, 1);
  for (int i = 0; i < 2000; ++i) {
    const double dark = i % 2 == 0 ? 1.0 : 0.005;  // both branches of f
    const Vec3d rgb = Vec3d{rng.uniform(), rng.uniform(), rng.uniform()} * dark;
    ASSERT_LT(length(linear_rgb_from_lab(lab_from_linear_rgb(rgb)) - rgb), 1e-12);
  }
}

TEST(Colorspace, TransferRoundTripsAndIsOdd) {
  for (int i = -100; i <= 200; ++i) {
    const double v = i / 100.0;
    EXPECT_NEAR(linear_from_srgb(srgb_from_linear(v)), v, 1e-7);  // the standard's two branches do not meet exactly
    EXPECT_EQ(srgb_from_linear(-v), -srgb_from_linear(v));
  }
  EXPECT_NEAR(srgb_from_linear(1.0), 1, 1e-15);
  EXPECT_NEAR(srgb_from_linear(0.18), 0.46135613, 1e-7);
}

TEST(Colorspace, LightnessDerivativeEqualsCentralDifference) {
  for (const double y : {0.001, 0.005, 0.0085, 0.0095, 0.05, 0.18, 0.7, 1.0, 3.0}) {
    constexpr double kStep = 1e-6;
    const double difference = (lightness_from_luminance(y + kStep) - lightness_from_luminance(y - kStep)) / (2 * kStep);
    EXPECT_NEAR(lightness_derivative(y) / difference, 1, 1e-7) << y;
  }
  EXPECT_NEAR(lightness_derivative(0.0), 903.2963, 1e-4);
}

TEST(Colorspace, LightnessInverts) {
  for (double lightness = 0; lightness <= 110; lightness += 0.5) {
    EXPECT_NEAR(lightness_from_luminance(luminance_from_lightness(lightness)), lightness, 1e-12);
  }
}

TYPED_TEST(ColorspaceReal, GamutMappingStaysInsideAndKeepsLightnessAndHue) {
  SequentialRng rng(3, 1);
  int mapped = 0;
  for (int i = 0; i < 3000; ++i) {
    const Lab<TypeParam> lab = {TypeParam(rng.uniform(1, 100)), TypeParam(rng.uniform(-120, 120)),
                                TypeParam(rng.uniform(-120, 120))};
    const Vec3<TypeParam> rgb = gamut_mapped_linear_rgb_from_lab(lab);
    for (int c = 0; c < 3; ++c) {
      ASSERT_GE(rgb[c], 0);
      ASSERT_LE(rgb[c], 1);
    }
    const Lab<TypeParam> back = lab_from_linear_rgb(rgb);
    ASSERT_NEAR(back.lightness, lab.lightness, 2e-3);
    ASSERT_NEAR(back.a * lab.b, back.b * lab.a, 0.05 * std::hypot(lab.a, lab.b));  // parallel
    ASSERT_GE(back.a * lab.a + back.b * lab.b, -0.01);                             // and not opposite
    ASSERT_LE(std::hypot(back.a, back.b), std::hypot(lab.a, lab.b) * TypeParam(1.001) + TypeParam(0.01));
    mapped += std::hypot(back.a - lab.a, back.b - lab.b) > 1 ? 1 : 0;
  }
  EXPECT_GT(mapped, 1000);  // the sample does leave the gamut
}

TEST(Colorspace, GamutMappingReachesTheBorder) {
  const Vec3d rgb = gamut_mapped_linear_rgb_from_lab<double>({50, 100, 100});
  const double smallest = std::min({rgb.x, rgb.y, rgb.z});
  const double largest = std::max({rgb.x, rgb.y, rgb.z});
  EXPECT_TRUE(smallest < 1e-9 || largest > 1 - 1e-9) << smallest << ' ' << largest;
}

TEST(Colorspace, GamutMappingLeavesColoursInsideAlone) {
  const Lab<double> lab = lab_from_linear_rgb<double>({0.2, 0.5, 0.3});
  EXPECT_EQ(gamut_mapped_linear_rgb_from_lab(lab), linear_rgb_from_lab(lab));
}

TEST(Colorspace, GamutMappingBeyondBlackAndWhite) {
  const Vec3f black = gamut_mapped_linear_rgb_from_lab<float>({-3, 20, 20});
  EXPECT_EQ(black, (Vec3f{0, 0, 0}));
  const Vec3f bright = gamut_mapped_linear_rgb_from_lab<float>({120, 30, -30});
  const float y = luminance_from_lightness(120.0f);
  EXPECT_LE(std::max({bright.x, bright.y, bright.z}), y);
  EXPECT_NEAR(luminance_of(bright), y, 1e-5);
}

}  // namespace
}  // namespace cnerf
