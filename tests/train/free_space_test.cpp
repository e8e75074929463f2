/// What sparse points say about the space before them.

#include "src/train/luminance/free_space.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace cnerf {
namespace {

constexpr double kRadius = 0.05;

/// Cameras at z = 0 that look along z at a wall of points at z = 4.
class FreeSpaceTest : public testing::Test {
 protected:
  FreeSpaceTest() {
    for (int i = 0; i < 4; ++i) {
      View view;
      view.intrinsics.width = view.intrinsics.height = 100;
      view.intrinsics.fx = view.intrinsics.fy = 100;
      view.intrinsics.cx = view.intrinsics.cy = 50;
      view.world_from_camera = {Mat3d::identity(), {0.2 * i, 0, 0}};
      views_.push_back(view);
    }
    for (int i = -4; i <= 4; ++i) {
      for (int j = -4; j <= 4; ++j) points_.push_back({{0.3 + 0.3 * i, 0.3 * j, 4}, 0.5, {0, 1, 2, 3}});
    }
  }
  [[nodiscard]] bool is_free(Vec3d at, double radius = kRadius) const {
    return FreeSpace(views_, points_).holds(at, radius);
  }

  std::vector<View> views_;
  std::vector<SparsePoint> points_;
};

TEST_F(FreeSpaceTest, ReachesFromTheLensesToShortlyBeforeThePoints) {
  for (const double z : {0.0, 0.1, 1.0, 2.0, 3.0, 3.5}) EXPECT_TRUE(is_free({0.3, 0, z})) << z;
  for (const double z : {3.7, 4.0, 4.5, 9.0}) EXPECT_FALSE(is_free({0.3, 0, z})) << z;
}

TEST_F(FreeSpaceTest, IsNotWhereNoViewLooks) {
  EXPECT_FALSE(is_free({0.3, 3.5, 3.5})) << "beside all pictures";
  EXPECT_FALSE(is_free({0.3, 0, -0.5})) << "behind the lenses";
}

TEST_F(FreeSpaceTest, WhatTwoViewsDoNotAgreeOnIsNotFree) {
  for (SparsePoint& point : points_) point.views = {0, 1, 2};
  EXPECT_TRUE(is_free({0.3, 0, 3.4}));
  views_[1].held_out = views_[2].held_out = true;  // one way is left
  EXPECT_FALSE(is_free({0.3, 0, 3.4}));
  EXPECT_TRUE(is_free({0.3, 0, 2})) << "much nearer than all that the view shows";
  views_[0].held_out = true;
  EXPECT_FALSE(is_free({0.3, 0, 2}));
}

TEST_F(FreeSpaceTest, ANearPointKeepsItsPlaceAndWhatIsBehindIt) {
  points_.push_back({{0.3, 0, 2}, 0.5, {0, 1, 2, 3}});
  EXPECT_FALSE(is_free({0.3, 0, 2}));
  EXPECT_FALSE(is_free({0.3, 0, 2.2}));
  EXPECT_TRUE(is_free({0.3, 0, 1.5}));
  EXPECT_TRUE(is_free({0.9, 0.4, 3})) << "beside it";
}

TEST_F(FreeSpaceTest, APointInTheBallIsAnObjectionWhoeverSawIt) {
  EXPECT_TRUE(is_free({0.3, 0, 1}));
  views_.push_back(views_.front());
  views_.back().held_out = false;
  points_.push_back({{0.31, 0, 1}, 0.5, {4, 4, 4}});
  EXPECT_FALSE(is_free({0.3, 0, 1}));
}

TEST_F(FreeSpaceTest, PointsOfFewViewsOrLargeErrorsSayNothing) {
  for (SparsePoint& point : points_) point.views = {0, 1};
  EXPECT_FALSE(is_free({0.3, 0, 2}));
  for (SparsePoint& point : points_) point = {point.position, 5, {0, 1, 2, 3}};
  EXPECT_FALSE(is_free({0.3, 0, 2}));
  points_.clear();
  EXPECT_FALSE(is_free({0.3, 0, 2}));
}

/// A file may state that a view shows what lies far beside its picture.
TEST_F(FreeSpaceTest, AViewThatDoesNotShowAPointSaysNothingAboutIt) {
  EXPECT_TRUE(is_free({0.3, 0, 3.4}));
  for (int i = 0; i < 9; ++i) {
    points_.push_back({{1e12, 1e12, 1e-3}, 0.5, {0, 1, 2, 3}});
    points_.push_back({{3, 0, 0.1}, 0.5, {0, 1, 2, 3}});
  }
  EXPECT_TRUE(is_free({0.3, 0, 3.4}));
  EXPECT_TRUE(is_free({0.3, 0, 0.1})) << "they are not what is nearest";
}

/// A wall along the way of view enters the pictures far ahead; what of it lies beside the lenses stays.
TEST_F(FreeSpaceTest, AWallBesideTheLensesStays) {
  points_.clear();
  for (int i = 0; i < 9; ++i) {
    for (int j = -3; j <= 3; ++j) points_.push_back({{1.5, 0.3 * j, 2.2 + 0.3 * i}, 0.5, {0, 1, 2, 3}});
  }
  EXPECT_FALSE(is_free({1.5, 0, 0.1}));
  EXPECT_TRUE(is_free({0.3, 0, 1.2}));
}

TEST_F(FreeSpaceTest, ReachesAllTheWayWhereTwoViewsSeeTheSkyAndNoPoint) {
  const auto sky_above = [&](std::size_t views) {
    std::vector<std::vector<SkyLabel>> sky(views_.size());
    for (std::size_t v = 0; v < views; ++v) {
      sky[v].assign(100 * 100, SkyLabel::kScene);
      std::fill_n(sky[v].begin(), 100 * 50, SkyLabel::kSky);  // the upper half, where y is negative
    }
    return sky;
  };
  const std::vector<SparsePoint> no_points;
  const FreeSpace two(views_, no_points, sky_above(2)), one(views_, no_points, sky_above(1));
  for (const double z : {1.0, 5.0, 50.0}) {
    EXPECT_TRUE(two.holds({0.1, -0.2 * z, z}, kRadius)) << z;
    EXPECT_FALSE(one.holds({0.1, -0.2 * z, z}, kRadius)) << z;
    EXPECT_FALSE(two.holds({0.1, 0.2 * z, z}, kRadius)) << z;
    EXPECT_FALSE(two.holds({0.1, -kRadius / 2, z}, kRadius)) << "reaches over the horizon";
  }
  EXPECT_FALSE(FreeSpace(views_, points_, sky_above(2)).holds({0.3, -0.6, 4}, kRadius)) << "a point is there";
}

}  // namespace
}  // namespace cnerf
