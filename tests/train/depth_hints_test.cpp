/// What sparse points say about the distance of what pictures show.

#include "src/train/luminance/depth_hints.h"

#include <gtest/gtest.h>

#include "src/engine/stage1_schedule.h"
#include "src/render/training_views.h"
#include "tests/support/facing_views.h"

namespace cnerf {
namespace {

/// Cameras at z = 0 that look along z at points; the last one is held out.
class DepthHintsTest : public testing::Test {
 protected:
  DepthHintsTest() {
    capture_.views = test::facing_views(4, 128, 0.1);
    capture_.views.back().held_out = true;
    frame_.unit_per_world = 0.25;
  }
  void add_point(Vec3d at, double error = 0.5, std::vector<std::uint32_t> views = {0, 1, 2}) {
    capture_.points.push_back({at, error, std::move(views)});
  }
  /// Of the first view, where it shows a point.
  [[nodiscard]] DepthHint hint_at(Vec3d point) const {
    const std::vector<DepthHints> all = depth_hints(capture_, frame_, capture_.points);
    if (all.empty()) return {};
    const DepthHints& hints = all.front();
    const PixelPosition pixel = project(capture_.views[0].intrinsics, point).value();
    return hints.cells[std::size_t(int(pixel.y / 2) * hints.columns + int(pixel.x / 2))];
  }

  Capture capture_;
  SceneFrame frame_;
};

TEST_F(DepthHintsTest, IsTheDistanceInUnitSpaceAtAPointAndLessSureAroundIt) {
  const Vec3d point = {0.5, 0.5, 4};
  add_point(point);
  const DepthHint at = hint_at(point), beside = hint_at({0.65, 0.5, 4}), far = hint_at({-1.5, 0.5, 4});
  ASSERT_TRUE(at.is_known());
  EXPECT_NEAR(std::exp(at.log_distance), 0.25 * length(point), 1e-4);
  ASSERT_TRUE(beside.is_known());
  EXPECT_LT(beside.sharpness, at.sharpness);
  EXPECT_FALSE(far.is_known());
}

TEST_F(DepthHintsTest, PointsThatDisagreeSayLittleOrNothing) {
  for (const double x : {0.5, 0.55}) add_point({x, 0.5, 4});
  const DepthHint agreed = hint_at({0.5, 0.5, 4});
  add_point({0.3, 0.34, 2.7});
  const DepthHint doubtful = hint_at({0.5, 0.5, 4});
  ASSERT_TRUE(agreed.is_known());
  ASSERT_TRUE(doubtful.is_known());
  EXPECT_LT(doubtful.sharpness, 0.7f * agreed.sharpness);
  add_point({0.06, 0.06, 0.5});
  add_point({0.065, 0.06, 0.5});
  EXPECT_FALSE(hint_at({0.5, 0.5, 4}).is_known());
}

TEST_F(DepthHintsTest, WhatIsNotBelievedOrNotSeenSaysNothing) {
  add_point({0.5, 0.5, 4}, 5);
  add_point({0.5, 0.5, 4}, 0.5, {0, 1});
  EXPECT_TRUE(depth_hints(capture_, frame_, capture_.points).empty());
  add_point({0.5, 0.5, -4});
  const std::vector<DepthHints> hints = depth_hints(capture_, frame_, capture_.points);
  ASSERT_EQ(hints.size(), 3u);  // the held-out view has none
  for (const DepthHint& hint : hints.front().cells) EXPECT_FALSE(hint.is_known());
}

TEST_F(DepthHintsTest, AViewThatShowsNoPointIsGivenNone) {
  capture_.views.push_back(capture_.views.front());
  add_point({0.5, 0.5, 4});
  const std::vector<DepthHints> hints = depth_hints(capture_, frame_, capture_.points);
  std::vector<TrainingView> views = training_views(capture_, frame_);
  ASSERT_EQ(views.size(), 4u);
  show_to(views, hints);
  EXPECT_NE(views[0].depths, nullptr);
  EXPECT_EQ(views[3].depths, nullptr);
}

TEST(DepthLearning, HalvesAndEnds) {
  const DepthLearning depth{0.01f, 500};
  EXPECT_FLOAT_EQ(depth.weight_at(0), 0.01f);
  EXPECT_FLOAT_EQ(depth.weight_at(1000), 0.0025f);
  EXPECT_GT(depth.weight_at(5000), 0);
  EXPECT_EQ(depth.weight_at(5001), 0);
  EXPECT_EQ(DepthLearning{}.weight_at(0), 0);
}

TEST(DepthMiss, IsNothingAtTheKnownDistanceAndBoundedElsewhere) {
  const DepthHint hint = {std::log(0.5f), 20};
  EXPECT_NEAR(depth_miss(0.5, hint), 0, 1e-12);
  EXPECT_NEAR(depth_miss(0.5 * std::exp(0.05), hint), 0.5, 1e-5);
  EXPECT_NEAR(depth_miss(0.5 * std::exp(-0.05), hint), 0.5, 1e-5);
  EXPECT_LT(depth_miss(1e3, hint), 1);
}

}  // namespace
}  // namespace cnerf
