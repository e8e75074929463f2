// Key frames and hints, carried from view to view over a scene whose geometry is known.

#include "src/train/chroma/known_color_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "src/base/error.h"
#include "src/train/chroma/likeness.h"
#include "tests/train/wall_views.h"

namespace cnerf {
namespace {
using test::kHeight;
using test::kWall;
using test::kWidth;
using test::look;

/// Colour of a point of the scene: every place has its own.
Ab color_at(Vec3f p) {
  return {80 * p.x, 80 * p.y};
}

Vec3f point_at(const CachedView& view, std::uint32_t pixel) {
  const Ray ray = view.camera.ray({double(pixel % kWidth) + 0.5, double(pixel / kWidth) + 0.5});
  return ray.at(view.samples[pixel].t);
}

KnownColors key_frame_of(const CachedView& view, const std::string& name) {
  KnownColors known{KnownColorKind::kKeyFrame, name, kWidth, kHeight, {}, {}};
  for (std::uint32_t p = 0; p < view.samples.size(); ++p) known.ab.push_back(color_at(point_at(view, p)));
  known.is_known.assign(known.ab.size(), 1);
  return known;
}

const std::vector<std::string> kNames = {"left.png", "right.png"};

TEST(KnownColors, AKeyFrameColorsWhatItShowsInOtherViewsAndNothingElse) {
  const std::vector<CachedView> views = {look(0.45f, true), look(0.55f, true)};
  const std::vector<KnownColors> known = {key_frame_of(views[0], kNames[0])};
  const KnownColorMap map = known_color_map(views, kNames, known);
  const double pixel = kWall / 50;  // of the wall, unit space
  int found = 0, hidden = 0;
  for (std::uint32_t p = 0; p < views[1].samples.size(); ++p) {
    const Vec3f point = point_at(views[1], p);
    const auto from = project(views[0].camera.intrinsics, point.cast<double>() - views[0].camera.origin);
    const bool is_in_picture = from && from->x >= 0 && from->y >= 0 && from->x < kWidth && from->y < kHeight;
    const Ab* color = map.find(1, p);
    if (!is_in_picture) {
      EXPECT_EQ(color, nullptr);
      continue;
    }
    const auto seen = std::uint32_t(int(from->y) * kWidth + int(from->x));
    const bool is_same_surface = std::abs(point_at(views[0], seen).z - point.z) < 0.01f;
    EXPECT_EQ(color != nullptr, is_same_surface) << "pixel " << p;
    hidden += is_same_surface ? 0 : 1;
    if (color == nullptr) continue;
    ++found;
    EXPECT_NEAR(color->a, color_at(point).a, 80 * pixel);
    EXPECT_NEAR(color->b, color_at(point).b, 80 * pixel);
  }
  EXPECT_GT(found, kWidth * kHeight / 2);
  EXPECT_GT(hidden, 50) << "the board hides a part of the wall from the key frame alone";
  EXPECT_EQ(std::size_t(found) + views[0].samples.size(), map.places().size());
}

TEST(KnownColors, WhatLooksDifferentIsNotTheSame) {
  const std::vector<CachedView> views = {look(0.45f, false, 0.1f), look(0.55f, false, 0.6f)};
  const std::vector<KnownColors> known = {key_frame_of(views[0], kNames[0])};
  const KnownColorMap map = known_color_map(views, kNames, known);
  for (std::uint32_t p = 0; p < views[1].samples.size(); ++p) EXPECT_EQ(map.find(1, p), nullptr);
}

TEST(KnownColors, AKeyFrameMayHaveAnySizeOfTheShape) {
  const std::vector<CachedView> views = {look(0.5f, false), look(0.5f, false)};
  const KnownColors small = key_frame_of(views[0], kNames[0]);
  KnownColors large{KnownColorKind::kKeyFrame, kNames[0], 3 * kWidth, 3 * kHeight, {}, {}};
  for (int y = 0; y < large.height; ++y) {
    for (int x = 0; x < large.width; ++x) large.ab.push_back(small.ab[std::size_t(y / 3 * kWidth + x / 3)]);
  }
  large.is_known.assign(large.ab.size(), 1);
  const KnownColorMap of_small = known_color_map(views, kNames, std::span(&small, 1)),
                      of_large = known_color_map(views, kNames, std::span(&large, 1));
  for (std::uint32_t p = 0; p < small.ab.size(); ++p) {
    ASSERT_NE(of_large.find(0, p), nullptr);
    EXPECT_NEAR(of_large.find(0, p)->a, of_small.find(0, p)->a, 1e-4);
  }
  ASSERT_EQ(of_large.key_frames().size(), 1u);
  EXPECT_EQ(of_large.key_frames()[0].ab.size(), 2 * small.ab.size());
}

KnownColors stroke_at(int x, int y, Ab color) {
  KnownColors strokes{KnownColorKind::kStrokes, kNames[0], kWidth, kHeight, {}, {}};
  strokes.ab.resize(std::size_t(kWidth) * kHeight);
  strokes.is_known.assign(strokes.ab.size(), 0);
  strokes.ab[std::size_t(y * kWidth + x)] = color;
  strokes.is_known[std::size_t(y * kWidth + x)] = 1;
  return strokes;
}

TEST(KnownColors, AThinLineOnALargePictureIsAStroke) {
  const std::vector<CachedView> views = {look(0.5f, false), look(0.5f, false)};
  KnownColors line{KnownColorKind::kStrokes, kNames[0], 4 * kWidth, 4 * kHeight, {}, {}};
  line.ab.resize(std::size_t(line.width) * std::size_t(line.height));
  line.is_known.assign(line.ab.size(), 0);
  for (int x = 0; x < line.width; ++x) {
    const auto p = std::size_t((4 * 20 + 1) * line.width + x);
    line.ab[p] = {50, 0};
    line.is_known[p] = 1;
  }
  const KnownColors small = resized_to(line, views[0]);
  for (std::size_t p = 0; p < small.ab.size(); ++p) {
    EXPECT_EQ(small.is_known[p] != 0, p / kWidth == 20) << "pixel " << p;
    EXPECT_EQ(small.ab[p].a, p / kWidth == 20 ? 50 : 0) << "pixel " << p;
  }
  EXPECT_FALSE(known_color_map(views, kNames, std::span(&line, 1)).places().empty());
  line.kind = KnownColorKind::kKeyFrame;
  const KnownColors frame = resized_to(line, views[0]);
  EXPECT_EQ(std::ranges::count(frame.is_known, 1), 0) << "of a picture most of a pixel";
}

RunningColors grown_from(const KnownColors& strokes, const CachedView& view) {
  RunningColors colors = running_colors(strokes);
  run(colors, view, surface_distance(view));
  return colors;
}

TEST(KnownColors, AStrokeStopsWhereLightnessOrDepthJumps) {
  CachedView view = look(0.5f, true);
  for (std::size_t p = 0; p < view.luminance.size(); ++p) {
    if (int(p) / kWidth >= kHeight / 2) view.luminance[p] = 0.9f;  // the lower half is bright
  }
  const RunningColors grown = grown_from(stroke_at(5, 5, {40, -20}), view);
  int colored = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto p = std::uint32_t(y * kWidth + x);
      if (!grown.is_known(p)) continue;
      ++colored;
      EXPECT_LT(y, kHeight / 2);
      EXPECT_NEAR(point_at(view, p).z, kWall, 1e-3) << "the board is another thing";
      EXPECT_EQ(grown.ab[p].a, 40);
    }
  }
  EXPECT_GT(colored, 200);
}

TEST(KnownColors, AStrokeRunsAsFarAsItsReach) {
  const CachedView view = look(0.5f, false);
  const auto reached = [](const RunningColors& colors) {
    return std::ranges::count_if(colors.cost, [](float cost) { return cost < kUnreached; });
  };
  const auto size_of = [&](float reach) {
    KnownColors stroke = stroke_at(30, 20, {50, 0});
    stroke.reach.assign(stroke.ab.size(), reach);
    return reached(grown_from(stroke, view));
  };
  EXPECT_EQ(size_of(0), 1) << "it stays where it was painted";
  const auto usual = size_of(1);
  EXPECT_EQ(usual, reached(grown_from(stroke_at(30, 20, {50, 0}), view)));
  EXPECT_NEAR(double(size_of(0.5f)) / double(usual), 0.25, 0.1) << "an area, cut by the borders of the picture";
}

TEST(KnownColors, OfTwoStrokesTheNearerCounts) {
  const CachedView view = look(0.5f, false);
  KnownColors strokes = stroke_at(20, 20, {50, 0});
  strokes.ab[20 * kWidth + 32] = {-50, 0};
  strokes.is_known[20 * kWidth + 32] = 1;
  const RunningColors grown = grown_from(strokes, view);
  EXPECT_EQ(grown.ab[20 * kWidth + 24].a, 50);
  EXPECT_EQ(grown.ab[20 * kWidth + 29].a, -50);
  EXPECT_FALSE(grown.is_known(20 * kWidth + 59)) << "too far from both";
}

TEST(KnownColors, AStrokeRunsOnInOtherViewsBeyondTheBorderOfItsOwn) {
  const std::vector<CachedView> views = {look(0.45f, false), look(0.55f, false)};
  KnownColors stroke = stroke_at(kWidth - 4, 20, {50, 0});
  const std::vector<KnownColors> known = {stroke};
  const KnownColorMap map = known_color_map(views, kNames, known);
  // What the left view has at its right border, the right view has further left.
  const float seen_up_to = point_at(views[0], 20 * kWidth + kWidth - 1).x;
  int beyond = 0;
  for (std::uint32_t x = 0; x < kWidth; ++x) {
    beyond += map.find(1, 20 * kWidth + x) != nullptr && point_at(views[1], 20 * kWidth + x).x > seen_up_to + 0.01f;
  }
  EXPECT_GT(beyond, 3);
  stroke.reach.assign(stroke.ab.size(), 0.0f);
  const std::vector<KnownColors> exact = {stroke};
  EXPECT_LE(known_color_map(views, kNames, exact).places().size(), 4u) << "in each view where it was painted alone";
}

void put(KnownColors& strokes, int x, int y, Ab color, float reach = 1) {
  const auto p = std::size_t(y * kWidth + x);
  if (strokes.reach.empty()) strokes.reach.assign(strokes.ab.size(), 1.0f);
  strokes.ab[p] = color;
  strokes.is_known[p] = 1;
  strokes.reach[p] = reach;
}

TEST(ColorsEverywhere, ColorAllThatThereIsEachWhatIsMostLikeThem) {
  std::vector<CachedView> views = {look(0.45f, true), look(0.75f, true)};
  for (CachedView& view : views) {
    for (std::uint32_t p = 0; p < view.opacity.size(); ++p) {
      if (point_at(view, p).z < kWall - 0.1f) view.luminance[p] = 0.6f;
    }
  }
  const auto is_board = [](const CachedView& view, std::uint32_t p) { return point_at(view, p).z < kWall - 0.1f; };
  KnownColors strokes = stroke_at(3, 20, {50, 0});
  std::uint32_t on_board = 20 * kWidth;
  while (!is_board(views[0], on_board)) ++on_board;
  put(strokes, int(on_board % kWidth) + 2, 20, {-50, 0});
  strokes.everywhere = true;
  const std::vector<KnownColors> known = {strokes};
  const KnownColorMap map = known_color_map(views, kNames, known);
  EXPECT_EQ(map.places().size(), views[0].opacity.size() + views[1].opacity.size());
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::uint32_t p = 0; p < views[v].opacity.size(); ++p) {
      ASSERT_NE(map.find(v, p), nullptr);
      EXPECT_EQ(map.find(v, p)->a < 0, is_board(views[v], p)) << "view " << v << " pixel " << p;
    }
  }
}

TEST(ColorsEverywhere, WhatIsPaintedExactlyStaysAndDoesNotRun) {
  const std::vector<CachedView> views = {look(0.45f, false), look(0.55f, false)};
  KnownColors strokes = stroke_at(20, 20, {50, 0});
  put(strokes, 40, 20, {-50, 0}, 0);
  put(strokes, 41, 20, {0, 0}, 0);
  strokes.everywhere = true;
  const std::vector<KnownColors> known = {strokes};
  const KnownColorMap map = known_color_map(views, kNames, known);
  EXPECT_EQ(map.find(0, 20 * kWidth + 40)->a, -50);
  EXPECT_EQ(map.find(0, 20 * kWidth + 41)->a, 0);
  EXPECT_NEAR(map.find(0, 20 * kWidth + 42)->a, 50, 1e-3);
  EXPECT_NEAR(map.find(0, 21 * kWidth + 40)->a, 50, 1e-3);
}

TEST(ColorsEverywhere, OnlyExactPaintColorsNothingElse) {
  const std::vector<CachedView> views = {look(0.45f, false), look(0.55f, false)};
  KnownColors strokes = stroke_at(20, 20, {50, 0});
  strokes.reach.assign(strokes.ab.size(), 0.0f);
  strokes.everywhere = true;
  const std::vector<KnownColors> known = {strokes};
  EXPECT_LE(known_color_map(views, kNames, known).places().size(), 4u);
}

TEST(ColorsEverywhere, AreTheSameEachTimeAndMixWhereTwoAreEquallyNear) {
  const std::vector<CachedView> views = {look(0.45f, false), look(0.55f, false)};
  KnownColors strokes = stroke_at(20, 20, {50, 0});
  put(strokes, 40, 20, {-50, 0});
  strokes.everywhere = true;
  const std::vector<KnownColors> known = {strokes};
  const KnownColorMap one = known_color_map(views, kNames, known), other = known_color_map(views, kNames, known);
  ASSERT_EQ(one.places().size(), other.places().size());
  for (const ViewPixel& place : one.places()) {
    EXPECT_EQ(one.find(place.view, place.pixel)->a, other.find(place.view, place.pixel)->a);
  }
  EXPECT_NEAR(one.find(0, 20 * kWidth + 30)->a, 0, 10) << "half way, but for half a pixel";
  EXPECT_LT(std::abs(one.find(0, 20 * kWidth + 29)->a), 35) << "and no edge beside it";
}

TEST(ColorsEverywhere, InTheShadeHaveLessChroma) {
  std::vector<CachedView> views = {look(0.45f, false), look(0.55f, false)};
  for (std::size_t p = 0; p < views[0].luminance.size(); ++p) {
    if (p % kWidth >= kWidth / 2) views[0].luminance[p] = 0.02f;
  }
  KnownColors strokes = stroke_at(10, 20, {50, 20});
  strokes.everywhere = true;
  const std::vector<KnownColors> known = {strokes};
  const KnownColorMap map = known_color_map(views, kNames, known);
  const Ab light = *map.find(0, 20 * kWidth + 15), dark = *map.find(0, 20 * kWidth + 50);
  EXPECT_NEAR(light.a, 50, 1e-3);
  EXPECT_LT(dark.a, 30);
  EXPECT_NEAR(dark.b / dark.a, 0.4, 1e-4) << "of the same hue";
}

TEST(ColorsEverywhere, OfStrokesInTwoViewsEachHasWhatIsMostLikeIt) {
  const std::vector<CachedView> views = {look(0.45f, false), look(0.55f, false)};
  KnownColors left = stroke_at(5, 20, {50, 0}), right = stroke_at(kWidth - 5, 20, {-50, 0});
  right.view = kNames[1];
  left.everywhere = right.everywhere = true;
  const std::vector<KnownColors> known = {left, right};
  const KnownColorMap map = known_color_map(views, kNames, known);
  for (std::size_t v = 0; v < views.size(); ++v) {
    EXPECT_GT(map.find(v, 20 * kWidth + 3)->a, 40) << "view " << v;
    EXPECT_LT(map.find(v, 20 * kWidth + kWidth - 4)->a, -40) << "view " << v;
  }
}

TEST(ColorsEverywhere, AStrokeThatSlipsClaimsLittleThere) {
  const CachedView view = look(0.45f, false);
  KnownColors strokes = stroke_at(8, 20, {50, 0});
  for (int x = 6; x < 15; ++x) put(strokes, x, 20, {50, 0});
  for (int x = 48; x < 57; ++x) put(strokes, x, 20, {-50, 0});
  put(strokes, 22, 20, {-50, 0});
  std::vector<float> surface;
  for (const auto& sample : view.samples) surface.push_back(sample.t);
  const StrokesEverywhere everywhere(running_colors(strokes), view, surface);
  Claims claims;
  everywhere.claim_alike(view.camera.ray_of_pixel(20 * kWidth + 20), PixelLooks(view, surface), 20 * kWidth + 20,
                         claims);
  EXPECT_EQ(claims.list[0].color.a, 50) << "nearer to most of the other stroke";
}

TEST(ColorsEverywhere, SharesOfWhatIsKeptSumToOne) {
  Claims claims;
  EXPECT_EQ(claims.shares(), (std::array<float, Claims::kMost>{}));
  claims.add({0.5f, {50, 0}});
  claims.add({0.5f, {-50, 0}});
  EXPECT_EQ(claims.shares(), (std::array<float, Claims::kMost>{0.5f, 0.5f, 0}));
  claims.add({0.9f, {0, 50}});
  const auto [first, second, third] = claims.shares();
  EXPECT_NEAR(first + second + third, 1, 1e-6f);
  EXPECT_NEAR(third, std::exp(-1.0f) * first, 1e-6f) << "0.4 dearer";
}

TEST(ColorsEverywhere, APixelIsJudgedWithThoseOfItsSurface) {
  const CachedView view = look(0.45f, true);
  const Ab red{50, 0}, green{-50, 0}, painted{0, 30};
  const auto is_board = [&](std::uint32_t p) { return point_at(view, p).z < kWall - 0.1f; };
  std::vector<float> surface;
  std::vector<Claims> claims(view.samples.size());
  for (std::uint32_t p = 0; p < claims.size(); ++p) {
    surface.push_back(view.samples[p].t);
    const bool is_red = is_board(p) != (p % 11 == 0);  // some look otherwise than what is around them
    claims[p].add({is_red ? 1.0f : 1.5f, red});
    claims[p].add({is_red ? 1.5f : 1.0f, green});
  }
  claims[5] = {};
  claims[5].add({0, painted});
  smooth(claims, view, surface);
  for (std::uint32_t p = 0; p < claims.size(); ++p) {
    const Ab expected = p == 5 ? painted : is_board(p) ? red : green;
    EXPECT_EQ(claims[p].list[0].color.a, expected.a) << "pixel " << p;
    EXPECT_EQ(claims[p].cost() <= 0, p == 5) << "pixel " << p;
  }
}

/// Which would cost a painted picture as much time as it has colours.
TEST(ColorsEverywhere, OfManyColorsThoseNearOneAnotherAreOne) {
  const CachedView view = look(0.45f, false);
  KnownColors strokes = stroke_at(0, 0, {0, 0});
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) put(strokes, x, y, {float(x), float(y)});
  }
  std::vector<float> surface;
  for (const auto& sample : view.samples) surface.push_back(sample.t);
  const StrokesEverywhere everywhere(running_colors(strokes), view, surface);
  const PixelLooks looks(view, surface);
  std::set<std::pair<float, float>> colors;
  for (std::uint32_t p = 0; p < view.samples.size(); ++p) {
    Claims claims;
    everywhere.claim_alike(view.camera.ray_of_pixel(p), looks, p, claims);
    for (const Claims::Claim& claim : claims.list) colors.emplace(claim.color.a, claim.color.b);
    const int x = int(p % kWidth), y = int(p / kWidth);
    if (x >= kWidth / 2) continue;
    EXPECT_NEAR(claims.list[0].color.a, float(x), 12) << "pixel " << p;
    EXPECT_NEAR(claims.list[0].color.b, float(y), 12) << "pixel " << p;
    EXPECT_EQ(everywhere.claims()[p].mixed(50).a, float(x)) << "what is painted stays";
  }
  EXPECT_LE(colors.size(), 64u);
  EXPECT_GE(colors.size(), 12u);
}

/// A painted picture may have more colours than there is time to smooth.
TEST(ColorsEverywhere, ManyColorsStayAsTheyAre) {
  const CachedView view = look(0.45f, false);
  std::vector<Claims> claims(view.samples.size());
  for (std::uint32_t p = 0; p < claims.size(); ++p) claims[p].add({1, {float(p % 500), 0}});
  smooth(claims, view, std::vector<float>(claims.size(), 1.0f));
  for (std::uint32_t p = 0; p < claims.size(); ++p) EXPECT_EQ(claims[p].list[0].color.a, float(p % 500));
}

TEST(KnownColors, HintsCorrectKeyFrames) {
  const std::vector<CachedView> views = {look(0.45f, false), look(0.55f, false)};
  const std::vector<KnownColors> known = {key_frame_of(views[0], kNames[0]), stroke_at(30, 20, {-60, -60})};
  const KnownColorMap map = known_color_map(views, kNames, known);
  ASSERT_NE(map.find(0, 20 * kWidth + 30), nullptr);
  EXPECT_EQ(map.find(0, 20 * kWidth + 30)->a, -60);
  EXPECT_GT(map.find(0, 0)->b, -60) << "far from the stroke the key frame holds";
}

TEST(KnownColors, AViewThatIsNotThereIsNamed) {
  const std::vector<CachedView> views = {look(0.5f, false), look(0.5f, false)};
  const std::vector<KnownColors> known = {key_frame_of(views[0], "middle.png")};
  EXPECT_THROW((void)known_color_map(views, kNames, known), UsageError);
}

TEST(KnownColors, TheirDescriptionTellsThemApart) {
  const KnownColors one = stroke_at(3, 3, {1, 2}), other = stroke_at(3, 3, {1, 3});
  EXPECT_EQ(describe({}), "");
  EXPECT_NE(describe(std::span(&one, 1)), describe(std::span(&other, 1)));
}

}  // namespace
}  // namespace cnerf
