// The finish of colours: of pixels and of samples alike.

#include "src/field/finish.h"

#include <gtest/gtest.h>

#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

Ab ab_of(Chromaticity color, double luminance) {
  const auto f = [](double v) { return std::cbrt(v); };
  return {float(500 * (f(luminance * color.x) - f(luminance))), float(200 * (f(luminance) - f(luminance * color.z)))};
}

TEST(Finish, APlainOneChangesNothing) {
  const Finish plain;
  EXPECT_TRUE(plain.is_plain());
  EXPECT_EQ(plain.gain(), 1.0f);
  EXPECT_FLOAT_EQ(plain.of(Ab{12, -34}).b, -34);
  EXPECT_NEAR(plain.of(Chromaticity{1.3f, 0.6f}).x, 1.3f, 1e-6);
}

TEST(Finish, TurnsAndScalesLab) {
  const Finish finish{.saturation = 2, .hue = 90, .exposure = -1};
  EXPECT_NEAR(finish.of(Ab{10, 0}).a, 0, 1e-5);
  EXPECT_NEAR(finish.of(Ab{10, 0}).b, 20, 1e-5);
  EXPECT_EQ(finish.gain(), 0.5f);
}

TEST(Finish, OfASampleIsThatOfItsColorAtEveryLuminance) {
  for (const Finish& finish : {Finish{.saturation = 0.4}, Finish{.saturation = 1.5, .hue = 20}, Finish{.hue = -170}}) {
    for (const Chromaticity color : {Chromaticity{1.1f, 0.8f}, Chromaticity{0.95f, 1.2f}, Chromaticity{1, 1}}) {
      for (const double luminance : {0.02, 0.2, 0.9}) {
        const Ab wanted = finish.of(ab_of(color, luminance)), got = ab_of(finish.of(color), luminance);
        EXPECT_NEAR(got.a, wanted.a, 1e-2);
        EXPECT_NEAR(got.b, wanted.b, 1e-2);
      }
    }
  }
}

}  // namespace
}  // namespace cnerf
