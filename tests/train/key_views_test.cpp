// Which views tell most about the others, over a scene whose geometry is known.

#include "src/train/chroma/key_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "src/color/ab_bins.h"
#include "tests/train/wall_views.h"

namespace cnerf {
namespace {
using test::kHeight;
using test::kWidth;
using test::look;

/// The wall grows brighter to the right: its ends do not look alike.
CachedView shaded(float x) {
  CachedView view = look(x, false);
  for (std::size_t p = 0; p < view.luminance.size(); ++p) {
    const Ray ray = view.camera.ray_of_pixel(p);
    const float at = ray.at(view.samples[p].t).x;
    view.luminance[p] = 0.05f + 0.33f * std::clamp(at + 0.4f, 0.0f, 2.8f);
  }
  return view;
}

std::vector<std::string> names_of(std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t v = 0; v < count; ++v) names.push_back("view" + std::to_string(v));
  return names;
}

/// Views along a wall, each half a picture further.
struct AlongTheWall {
  std::vector<CachedView> views;
  std::vector<std::string> names;
  SeenSurfaces seen;
  explicit AlongTheWall(int count) : views(made(count)), names(names_of(views.size())), seen(views, names) {}
  static std::vector<CachedView> made(int count) {
    std::vector<CachedView> views;
    for (int v = 0; v < count; ++v) views.push_back(shaded(0.1f + 0.45f * float(v)));
    return views;
  }
};

TEST(KeyViews, PointsAreSpreadEvenlyOverWhatViewsShow) {
  AlongTheWall wall(3);
  std::fill_n(wall.views[1].opacity.begin(), kWidth * kHeight / 2, 0.0f);
  const SeenSurfaces seen(wall.views, wall.names);
  const ScenePoints points = scene_points(seen, 300);
  ASSERT_EQ(points.pixels.size(), 300u);
  ASSERT_EQ(points.looks.size(), 300u);
  for (std::uint32_t v = 0; v < 3; ++v) EXPECT_EQ(std::ranges::count(points.pixels, v, &ViewPixel::view), 100);
  for (const ViewPixel& point : points.pixels) {
    const bool is_shown = point.view != 1 || point.pixel >= std::uint32_t(kWidth * kHeight / 2);
    EXPECT_TRUE(is_shown) << "the upper half of that view shows nothing";
  }
}

TEST(KeyViews, TheMiddleOfAWallTellsMostAndItsEndsComeNext) {
  const AlongTheWall wall(5);
  const ScenePoints points = scene_points(wall.seen, 2000);
  const std::vector<KeyView> chosen = choose_key_views(wall.seen, points, {}, 9).chosen;
  ASSERT_EQ(chosen.size(), 5u) << "there are no more";
  EXPECT_EQ(chosen[0].view, 2u);
  EXPECT_NE(chosen[1].view, 1u) << "half of it is seen already";
  EXPECT_NE(chosen[1].view, 3u);
  double told = 0;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    EXPECT_GT(chosen[i].shows, 0.2);
    EXPECT_LE(chosen[i].adds, i == 0 ? 1.0 : chosen[i - 1].adds) << "a view adds the less the more is told";
    told += chosen[i].adds;
  }
  EXPECT_NEAR(told, 1, 1e-5) << "all views together show all there is";
  const std::vector<KeyView> alone = choose_key_views(wall.seen, points, {}, 1).alone;
  ASSERT_EQ(alone.size(), 5u);
  EXPECT_DOUBLE_EQ(alone[2].adds, chosen[0].adds);
  for (const KeyView& one : alone) EXPECT_GE(one.adds, one.shows) << "what is shown is told";
}

TEST(KeyViews, WhatHasColorsAlreadyIsNotAskedFor) {
  const AlongTheWall wall(5);
  const ScenePoints points = scene_points(wall.seen, 2000);
  const std::vector<std::size_t> given = {2};
  const std::vector<KeyView> first = choose_key_views(wall.seen, points, {}, 2).chosen,
                             next = choose_key_views(wall.seen, points, given, 1).chosen;
  ASSERT_EQ(next.size(), 1u);
  EXPECT_EQ(next[0].view, first[1].view);
  EXPECT_DOUBLE_EQ(next[0].adds, first[1].adds);
}

TEST(KeyViews, WhatLooksLikeSomethingSeenIsToldInPart) {
  // Two walls that do not see each other: alike in one scene, of other looks in the other.
  const auto adds_of_second = [](float luminance) {
    const std::vector<CachedView> views = {look(0.2f, false, 0.3f), look(5, false, luminance)};
    const std::vector<std::string> names = names_of(2);
    const SeenSurfaces seen(views, names);
    const std::vector<std::size_t> given = {0};
    return choose_key_views(seen, scene_points(seen, 400), given, 1).chosen.at(0).adds;
  };
  EXPECT_NEAR(adds_of_second(0.9f), 0.5, 0.01) << "half of all pixels, and nothing is known of them";
  EXPECT_LT(adds_of_second(0.3f), 0.25);
  EXPECT_GT(adds_of_second(0.3f), 0.05) << "to be shown is better than to look like what is";
}

TEST(KeyViews, DoubtMovesTheChoice) {
  const AlongTheWall wall(5);
  ScenePoints points = scene_points(wall.seen, 2000);
  for (std::size_t p = 0; p < points.doubt.size(); ++p) points.doubt[p] = points.pixels[p].view == 0 ? 5.0f : 0.01f;
  EXPECT_EQ(choose_key_views(wall.seen, points, {}, 1).chosen.at(0).view, 0u);
  std::ranges::fill(points.doubt, 0.0f);
  EXPECT_TRUE(choose_key_views(wall.seen, points, {}, 1).chosen.empty()) << "nothing is in doubt";
}

/// F of a set is the sum of what its views add one after another.
TEST(KeyViews, GreedyViewsTellNearlyAsMuchAsTheBestPair) {
  const AlongTheWall wall(6);
  const ScenePoints points = scene_points(wall.seen, 1200);
  const std::vector<KeyView> greedy = choose_key_views(wall.seen, points, {}, 2).chosen;
  double best = 0;
  for (std::size_t first = 0; first < 6; ++first) {
    // What is told by the first alone is what nothing else could add to the whole, which is 1.
    const std::vector<std::size_t> given = {first};
    double rest = 0;
    const std::vector<KeyView> others = choose_key_views(wall.seen, points, given, 6).chosen;
    for (const KeyView& one : others) rest += one.adds;
    best = std::max(best, 1 - rest + others.at(0).adds);
  }
  EXPECT_GE(greedy[0].adds + greedy[1].adds, (1 - std::exp(-1.0)) * best);
  EXPECT_LE(greedy[0].adds + greedy[1].adds, best + 1e-6);
}

/// The mean distance of a distribution's colours from their mean: none where one bin has it all, half of their distance
/// where two bins share it.
TEST(KeyViews, ATakesDoubtIsTheSpreadOfItsDistribution) {
  const auto centres = ab_bin_centres();
  std::vector<float> logits(kAbBinCount, -1e4f);
  logits[10] = 0;
  EXPECT_NEAR(spread_of(logits), 0, 1e-4);
  logits[200] = 0;
  EXPECT_NEAR(spread_of(logits), std::hypot(centres[10].a - centres[200].a, centres[10].b - centres[200].b) / 2, 1e-3);
}

}  // namespace
}  // namespace cnerf
