/// The colours of a take's sky: what answers say of it, and what is known better.

#include "src/train/chroma/sky_colors.h"

#include <gtest/gtest.h>

#include "src/picture/picture.h"

namespace cnerf {
namespace {

constexpr Ab kBlue{-3, -25}, kRed{40, 30};

/// Looks along +x; the upper half shows nothing but the sky.
CachedView half_sky() {
  CachedView view;
  view.width = 32;
  view.height = 24;
  view.camera.intrinsics = {LensModel::kPinhole, view.width, view.height, 30, 30, 16, 12, {}};
  view.camera.unit_from_camera = Mat3d::from_columns({0, -1, 0}, {0, 0, -1}, {1, 0, 0});
  view.camera.origin = {0.5, 0.5, 0.5};
  for (int p = 0; p < view.width * view.height; ++p) {
    const bool is_sky = p / view.width < view.height / 2;
    view.opacity.push_back(is_sky ? 0.0f : 1.0f);
    view.luminance.push_back(is_sky ? 0.6f : 0.2f);
    view.offsets.push_back(0);
  }
  view.offsets.push_back(0);
  return view;
}

double distance(Ab one, Ab other) {
  return std::hypot(double(one.a - other.a), double(one.b - other.b));
}

TEST(SkyColors, AreGreyBeforeAnythingIsSaid) {
  const SkyColors sky = SkyColors::grey();
  EXPECT_TRUE(sky.exists());
  EXPECT_TRUE(sky.is_grey());
  EXPECT_EQ(distance(sky.along({1, 0, 0}), {}), 0);
  EXPECT_FALSE(SkyColors().exists());
}

TEST(SkyColors, AreWhatIsSaidOfPixelsThatTheFieldDoesNotCover) {
  const CachedView view = half_sky();
  SkyColors sky = SkyColors::grey();
  for (std::size_t p = 0; p < view.opacity.size(); ++p) sky.add(view, p, view.opacity[p] < 0.5f ? kBlue : kRed);
  sky.refresh();
  EXPECT_LT(distance(sky.along(normalized(Vec3f{1, 0, 0.2f})), kBlue), 1e-3);
  EXPECT_LT(distance(sky.along(normalized(Vec3f{-1, 0.3f, -0.5f})), kBlue), 1e-3) << "goes on where nobody looked";
}

TEST(SkyColors, WhatIsKnownOverrulesAnswers) {
  const std::vector<CachedView> views{half_sky()};
  const std::vector<std::string> names{"view"};
  SkyColors sky = SkyColors::grey();
  for (std::size_t p = 0; p < views[0].opacity.size(); ++p) sky.add(views[0], p, kBlue, 3);
  KnownColors painted{KnownColorKind::kKeyFrame, "view", 32, 24, {}, {}};
  painted.ab.assign(views[0].opacity.size(), kRed);
  painted.is_known.assign(views[0].opacity.size(), 1);
  sky.add(views, known_color_map(views, names, std::span(&painted, 1)));
  sky.refresh();
  EXPECT_LT(distance(sky.along(normalized(Vec3f{1, 0, 0.2f})), kRed), 0.5);
}

/// A picture of one colour for one of those views.
KnownColors painted(KnownColorKind kind, const std::string& view, Ab color) {
  KnownColors known{kind, view, 32, 24, std::vector<Ab>(32 * 24, color), std::vector<std::uint8_t>(32 * 24, 1)};
  if (kind == KnownColorKind::kStrokes) known.reach.assign(32 * 24, 0.0f);
  return known;
}

TEST(SkyColors, EachOfTwoPaintedViewsTellsOfItsPart) {
  std::vector<CachedView> views{half_sky(), half_sky()};
  views[1].camera.unit_from_camera = Mat3d::from_columns({0, 1, 0}, {0, 0, -1}, {-1, 0, 0});
  const std::vector<std::string> names{"east", "west"};
  for (const KnownColorKind kind : {KnownColorKind::kKeyFrame, KnownColorKind::kStrokes}) {
    for (const bool everywhere : {false, true}) {
      std::vector<KnownColors> known{painted(kind, "east", kRed), painted(kind, "west", kBlue)};
      for (KnownColors& one : known) one.everywhere = everywhere && kind == KnownColorKind::kStrokes;
      SkyColors sky = SkyColors::grey();
      sky.add(views, known_color_map(views, names, known));
      sky.refresh();
      EXPECT_LT(distance(sky.along(normalized(Vec3f{1, 0, 0.2f})), kRed), 0.5) << everywhere;
      EXPECT_LT(distance(sky.along(normalized(Vec3f{-1, 0, 0.2f})), kBlue), 0.5) << everywhere;
    }
  }
}

TEST(SkyColors, WhatAMaskIgnoresIsNoSky) {
  CachedView view = half_sky();
  MonoImage image;
  image.width = view.width;
  image.height = view.height;
  image.mask.assign(view.opacity.size(), 255);
  std::fill_n(image.mask.begin(), view.opacity.size() / 2, std::uint8_t(0));
  ignore_masked(view, image);
  SkyColors sky = SkyColors::grey();
  for (std::size_t p = 0; p < view.opacity.size(); ++p) sky.add(view, p, kRed);
  EXPECT_TRUE(sky.is_grey());
}

TEST(SkyColors, LieBehindWhatTheFieldLetsThrough) {
  CachedView view = half_sky();
  SkyColors sky = SkyColors::grey();
  for (std::size_t p = 0; p < view.opacity.size(); ++p) sky.add(view, p, kBlue);
  sky.refresh();
  EXPECT_LT(distance(sky.behind(view, 40, 0, {}), kBlue), 0.1) << "all of it";
  EXPECT_LT(distance(sky.behind(view, 700, view.luminance[700], kRed), kRed), 0.1) << "none of it";
  const Ab half = mixed(kRed, 0.3f, kBlue, 0.3f);
  const Vec3f light = linear_rgb_at(0.3f, kRed) + linear_rgb_at(0.3f, kBlue);
  const Lab<float> expected = lab_from_linear_rgb(light);
  EXPECT_LT(distance(half, {expected.a, expected.b}), 1e-4);
  EXPECT_LT(distance(sky.behind(view, 40, 0.3f, kRed), half), 0.1);
}

TEST(SkyColors, ASnapshotsNumbersGiveTheSameColors) {
  const CachedView view = half_sky();
  SkyColors sky = SkyColors::grey();
  for (std::size_t p = 0; p < view.opacity.size(); p += 3) sky.add(view, p, {float(p % 40), -float(p % 17)});
  sky.refresh();
  SkyColors again(sky.width());
  again.sums() = sky.sums();
  again.refresh();
  for (const float z : {0.1f, 0.3f, -0.2f}) {
    const Vec3f direction = normalized(Vec3f{1, 0.2f, z});
    EXPECT_EQ(distance(again.along(direction), sky.along(direction)), 0);
  }
}

TEST(ColoredSky, HasItsLightAndTheFinishOfTheScene) {
  const std::vector<float> light(16 * 8, 0.4f);
  ColoredSky sky{{light.data(), 16, 8}, nullptr, {}};
  EXPECT_NEAR(luminance_of(sky.along({0, 1, 0})), 0.4f, 1e-5f);
  sky.finish.exposure = -1;
  EXPECT_NEAR(luminance_of(sky.along({0, 1, 0})), 0.2f, 1e-5f);
}

TEST(ColoredSky, ExposureMultipliesItsColors) {
  const CachedView view = half_sky();
  SkyColors colors = SkyColors::grey();
  for (std::size_t p = 0; p < view.opacity.size(); ++p) colors.add(view, p, kRed);
  colors.refresh();
  const std::vector<float> light(16 * 8, 0.3f);
  for (const Finish& finish : {Finish{}, Finish{.saturation = 1.5, .hue = 20}}) {
    const ColoredSky sky{{light.data(), 16, 8}, &colors, finish};
    ColoredSky exposed = sky;
    exposed.finish.exposure = 1;
    const Vec3f before = sky.along({1, 0, 0.2f}), after = exposed.along({1, 0, 0.2f});
    EXPECT_GT(before.x - before.z, 0.1f) << "it is red";
    for (int c = 0; c < 3; ++c) EXPECT_FLOAT_EQ(after[c], 2 * before[c]);
  }
}

}  // namespace
}  // namespace cnerf
