#include "src/capture/arrangement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace cnerf {
namespace {

/// A camera that looks from one place towards another; the pictures' tops point to +z.
View view_at(Vec3d eye, Vec3d target) {
  View view;
  const Vec3d forward = normalized(target - eye), right = normalized(cross(forward, Vec3d{0, 0, 1}));
  view.world_from_camera = {Mat3d::from_columns(right, cross(forward, right), forward), eye};
  return view;
}

/// Cameras on an arc of radius 2 about the origin.
std::vector<View> arc(double degrees, int count) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    const double angle = (i / double(count - 1) - 0.5) * degrees * std::numbers::pi / 180;
    views.push_back(view_at({2 * std::cos(angle), 2 * std::sin(angle), 0}, {0, 0, 0}));
  }
  return views;
}

std::vector<View> wall() {
  std::vector<View> views;
  for (int i = -3; i <= 3; ++i) views.push_back(view_at({0, 0.1 * i, 0}, {1, 0.1 * i, 0}));
  return views;
}

TEST(Arrangement, IsForwardFacingWhereAllAxesAreWithinThirtyDegrees) {
  EXPECT_TRUE(arrangement_of(wall()).forward_facing);
  EXPECT_TRUE(arrangement_of(arc(50, 9)).forward_facing);
  EXPECT_FALSE(arrangement_of(arc(70, 9)).forward_facing);
  EXPECT_FALSE(arrangement_of(arc(350, 9)).forward_facing);
  const std::vector<View> opposite = {view_at({1, 0, 0}, {0, 0, 0}), view_at({-1, 0, 0}, {0, 0, 0})};
  EXPECT_FALSE(arrangement_of(opposite).forward_facing) << "axes that cancel have no mean";
}

TEST(Arrangement, FocusLiesWhereAxesMeetOrAtTheTypicalDepth) {
  EXPECT_NEAR(length(arrangement_of(arc(180, 9)).focus), 0, 1e-9);
  EXPECT_NEAR(length(arrangement_of(wall(), {}, DepthRange{2, 8}).focus - Vec3d{1 / (0.25 / 2 + 0.75 / 8), 0, 0}), 0,
              1e-9);
  EXPECT_NEAR(arrangement_of(wall(), {{3, 0, 0}, {4, 1, 0}, {9, 0, 0}, {-5, 0, 0}}).focus.x, 4, 1e-9)
      << "what lies behind does not count";
  EXPECT_NEAR(arrangement_of(wall()).focus.x, 4 * 0.3, 1e-9);
}

TEST(Arrangement, ParallelAxesMeetNowhere) {
  EXPECT_NEAR(length(arrangement_of(wall()).meeting_point - Vec3d{1, 0, 0}), 0, 1e-9) << "a step ahead of the cameras";
  EXPECT_FALSE(nearest_point({{{0, 0, 0}, {1, 0, 0}}, {{0, 1, 0}, {1, 0, 0}}}, 1e-10));
}

TEST(Arrangement, MeansOfTheCameras) {
  const CameraArrangement cameras = arrangement_of(wall());
  EXPECT_NEAR(length(cameras.eye), 0, 1e-12);
  EXPECT_NEAR(length(cameras.forward - Vec3d{1, 0, 0}), 0, 1e-12);
  EXPECT_NEAR(length(cameras.up - Vec3d{0, 0, 1}), 0, 1e-12);
  EXPECT_NEAR(mean_distance(wall(), {0, 0, 4}), 4, 0.02);
}

}  // namespace
}  // namespace cnerf
