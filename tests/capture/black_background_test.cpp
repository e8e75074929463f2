#include "src/capture/black_background.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/rng.h"
#include "src/capture/load_capture.h"
#include "src/sample/sample_scene.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

constexpr int kWidth = 160, kHeight = 120;

double from_centre(int x, int y) {
  return std::hypot(x - 80, y - 60);
}

/// A grey disc with a black hole in it, before `background`, with grain.
View disc(int background, double grain, int seed = 1) {
  SequentialRng rng(std::uint64_t(seed), 0);
  View view;
  view.image.width = kWidth;
  view.image.height = kHeight;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double r = from_centre(x, y);
      const double code = (r < 12 ? 0 : r < 45 ? 140 : background) + grain * double(rng.normal());
      view.image.u8.push_back(std::uint8_t(std::clamp(std::lround(code), 0l, 255l)));
    }
  }
  return view;
}

class BeforeBlack : public testing::TestWithParam<double> {};

TEST_P(BeforeBlack, WhatIsAroundTheObjectIsEmptyAndWhatIsBlackWithinStays) {
  std::vector<View> views = {disc(0, GetParam(), 1), disc(3, GetParam(), 2)};
  ASSERT_TRUE(cut_out_of_black(views));
  for (const View& view : views) {
    int wrong = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const std::size_t p = std::size_t(y * kWidth + x);
        const double r = from_centre(x, y);
        if (std::abs(r - 45) < 3) continue;
        wrong += (view.image.alpha[p] == 0) != (r > 45);
        if (view.image.alpha[p] == 0) {
          EXPECT_EQ(view.image.luminance(p), 0);
        }
      }
    }
    EXPECT_LT(wrong, kWidth * kHeight / 200);
  }
}
INSTANTIATE_TEST_SUITE_P(Grain, BeforeBlack, testing::Values(0.0, 2.0, 4.0));

TEST(BlackBackground, OtherPicturesAreLeftAsTheyAre) {
  const View before_black = disc(0, 1);
  View lit = disc(40, 1), dim = disc(36, 0);
  for (std::uint8_t& code : dim.image.u8) code = std::uint8_t(code / 12);  // 3 codes before 11
  for (const View& other : {lit, dim}) {
    std::vector<View> views = {before_black, other};
    EXPECT_FALSE(cut_out_of_black(views));
    EXPECT_TRUE(views[0].image.alpha.empty());
    EXPECT_EQ(views[0].image.u8, before_black.image.u8);
  }
}

TEST(BlackBackground, TheSampleWithoutItsAlphaIsCutOutAsItsAlphaSays) {
  const test::TempDir folder;
  SampleSceneOptions options;
  options.views = 4;
  options.width = 240;
  options.height = 180;
  options.samples_per_pixel = 4;
  write_sample_scene(folder.path(), options);
  const Capture truth = load_capture(folder.path());
  std::vector<View> views = truth.views;
  for (View& view : views) view.image.alpha.clear();
  ASSERT_TRUE(cut_out_of_black(views));
  for (std::size_t v = 0; v < views.size(); ++v) {
    double wrong = 0;
    for (std::size_t p = 0; p < views[v].image.pixel_count(); ++p) {
      wrong += std::abs(views[v].image.coverage(p) - truth.views[v].image.coverage(p));
    }
    EXPECT_LT(wrong / double(views[v].image.pixel_count()), 0.03) << views[v].name;
  }
}

class RealScenes : public testing::TestWithParam<const char*> {};

TEST_P(RealScenes, AreNotTakenForObjectsBeforeBlack) {
  CNERF_REQUIRE_DATA(folder, GetParam());
  const Capture capture = load_capture(folder, {.downscale = 4});
  EXPECT_FALSE(capture.is_bounded_object);
}
INSTANTIATE_TEST_SUITE_P(, RealScenes, testing::Values("scenes/fox", "scenes/flower", "scenes/robovision"));

}  // namespace
}  // namespace cnerf
