// Space about which the views say nothing stays out of stage 1.

#include <gtest/gtest.h>

#include "src/capture/arrangement.h"
#include "src/train/luminance/luminance_model.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

/// Twelve long lenses around a small thing: no two neighbours see the same just before their lenses.
Capture long_lenses() {
  Capture capture = test::toy_capture(12);
  for (View& view : capture.views) view.intrinsics.fx = view.intrinsics.fy = 3.0 * view.image.width;
  return capture;
}

class Exclusion : public testing::Test {
 protected:
  explicit Exclusion(const Capture& capture = long_lenses())
      : capture_(capture), model_(LuminanceModel::create(capture_, small_options(), cpu_engines())) {}

  static Stage1Options small_options() {
    Stage1Options options;
    options.grid.levels = 2;
    options.grid.log2_rows = 8;
    options.occupancy.resolution = 64;
    return options;
  }
  /// On the axis of the first camera, `distance` before it.
  [[nodiscard]] Vec3d before_the_lens(double distance) const {
    const Affined& pose = capture_.views.front().world_from_camera;
    return pose.translation + pose.linear.column(2) * distance;
  }
  [[nodiscard]] bool is_left_out(Vec3d world) const {
    const Vec3f p = model_.frame.unit_from_world(world).cast<float>();
    const OccupancyGrid& grid = model_.engine->occupancy();
    return !grid.occupied(grid.cascade_of(p), p);  // before the first step, all that is not left out counts as occupied
  }

  Capture capture_;
  LuminanceModel model_;
};

TEST_F(Exclusion, WhatOneViewAloneSeesInFrontOfTheObjectIsLeftOut) {
  EXPECT_TRUE(is_left_out(before_the_lens(0.6)));
}

TEST_F(Exclusion, WhatTheViewsLookAtAndWhatIsBehindItStays) {
  const Vec3d focus = arrangement_of(capture_).meeting_point;
  EXPECT_NEAR(length(focus), 0, 1e-6);
  const double distance = length(capture_.views.front().world_from_camera.translation - focus);
  EXPECT_FALSE(is_left_out(focus));
  EXPECT_FALSE(is_left_out(before_the_lens(1.1 * distance)));
  EXPECT_FALSE(is_left_out(before_the_lens(1.4 * distance))) << "one view sees it, as background";
}

/// Points at the focus that all views show.
TEST_F(Exclusion, TheWayToSparsePointsIsLeftOutUnlessTheOptionSaysNo) {
  capture_ = test::toy_capture(12);
  std::vector<SparsePoint> points;
  for (int i = 0; i < 27; ++i) {
    const int row = i / 3 % 3, layer = i / 9;
    points.push_back({Vec3d{i % 3 - 1.0, row - 1.0, layer - 1.0} * 0.1, 0.5, {}});
    for (std::uint32_t view = 0; view < 12; ++view) points.back().views.push_back(view);
  }
  Stage1Options options = small_options();
  const double distance = length(capture_.views.front().world_from_camera.translation);
  for (const bool free_space : {false, true}) {
    options.free_space = free_space;
    capture_.points = points;
    model_ = LuminanceModel::create(capture_, options, cpu_engines());
    EXPECT_EQ(is_left_out(before_the_lens(0.5 * distance)), free_space);
    EXPECT_FALSE(is_left_out({0, 0, 0})) << "where points are";
  }
}

TEST_F(Exclusion, WhatNoViewSeesIsLeftOut) {
  EXPECT_TRUE(is_left_out({0, 0, 3.5}));
}

/// Side by side, before what they look at.
class WideFisheyes : public Exclusion {
 protected:
  WideFisheyes() : Exclusion(wide_fisheyes()) {}

  /// Each shows all that is up to 99 degrees from its axis, in the corners of its picture.
  static Capture wide_fisheyes() {
    Capture capture = test::toy_capture(7);
    for (int i = 0; i < 7; ++i) {
      View& view = capture.views[std::size_t(i)];
      const double y = i - 3;
      view.intrinsics.model = LensModel::kOpenCvFisheye;
      view.intrinsics.fx = view.intrinsics.fy = 9;
      view.world_from_camera = test::look_at({0, 0.1 * y, 0}, {3, 0.12 * y, 0.01 * y});
    }
    return capture;
  }
};
TEST_F(WideFisheyes, WhatTheySeeBesideThemStays) {
  Stage1Options options = small_options();
  options.placement.centre = "0,0,0";  // a box that reaches behind them
  model_ = LuminanceModel::create(capture_, options, cpu_engines());
  EXPECT_FALSE(is_left_out({1, 0, 0}));
  EXPECT_FALSE(is_left_out({-0.08, 1, 0})) << "in the rim of a picture";
  EXPECT_TRUE(is_left_out({-1, 0, 0})) << "behind all of them";
}

/// With few views there is nobody to agree.
class FewViews : public Exclusion {
 protected:
  FewViews() : Exclusion(test::toy_capture(3)) {}
};
TEST_F(FewViews, OneViewIsEnough) {
  EXPECT_FALSE(is_left_out(before_the_lens(1.5)));
}

}  // namespace
}  // namespace cnerf
