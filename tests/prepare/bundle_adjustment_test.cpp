/// Cameras that are wrong in known ways, and what their pictures make good again.

#include "src/prepare/bundle_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "src/base/error.h"
#include "src/base/statistics.h"
#include "src/evaluate/pose_alignment.h"
#include "src/train/luminance/learned_views.h"
#include "tests/support/disturbed_capture.h"
#include "tests/support/smooth_noise.h"

namespace cnerf::prepare {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Where a ray meets the floor z = 0 or the wall y = 1.5.
Vec3d seen_by(Vec3d origin, Vec3d direction) {
  const double to_floor = direction.z < 0 ? -origin.z / direction.z : 1e9;
  const double to_wall = direction.y > 0 ? (1.5 - origin.y) / direction.y : 1e9;
  return origin + direction * std::min(to_floor, to_wall);
}

constexpr Intrinsics kPinhole = {LensModel::kPinhole, 240, 180, 210, 210, 120, 90, {}};

/// Twelve cameras on an arc that look into the corner between a floor and a wall, the third one held out.
Capture corner_capture(const Intrinsics& lens = kPinhole) {
  Capture capture;
  for (int i = 0; i < 12; ++i) {
    View view;
    view.name = std::to_string(i);
    view.intrinsics = lens;
    view.image.width = 240;
    view.image.height = 180;
    const double angle = (i - 5.5) * 9 * kDegree;
    const Vec3d centre{2.2 * std::sin(angle), 1.2 - 2.2 * std::cos(angle), 1.4 + 0.15 * (i % 3)};
    const Vec3d forward = normalized(Vec3d{0, 1.2, 0.4} - centre);
    const Vec3d right = normalized(cross(forward, Vec3d{0, 0, 1}));
    view.world_from_camera = {Mat3d::from_columns(right, cross(forward, right), forward), centre};
    for (std::size_t p = 0; p < view.image.pixel_count(); ++p) {
      const PixelPosition pixel{double(p % 240) + 0.5, std::floor(double(p) / 240) + 0.5};
      const Vec3d direction = view.world_from_camera.direction(ray_direction(view.intrinsics, pixel));
      const Vec3d at = seen_by(centre, direction);
      view.image.u8.push_back(std::uint8_t(std::lround(255 * test::smooth_noise(at.x, at.y - at.z))));
    }
    view.held_out = i == 2;
    capture.views.push_back(std::move(view));
  }
  return capture;
}

double degrees_off(const Capture& capture, const std::vector<Affined>& truth) {
  return align_poses(test::training_poses(capture), truth, 1).median_degrees;
}

Stage1Options learning(bool poses, bool lenses) {
  Stage1Options options;
  options.poses = poses;
  options.lenses = lenses;
  return options;
}

TEST(BundleAdjustment, FindsCamerasThatStandElsewhere) {
  Observer silent;
  Capture capture = corner_capture();
  const std::vector<Affined> truth = test::training_poses(capture);
  const Affined held_out = capture.views[2].world_from_camera;
  test::disturb(capture, {.degrees = 0.4, .shift = 0.004});
  Capture again = capture;
  const double before = degrees_off(capture, truth);
  const AdjustedCameras found = adjust_cameras(capture, learning(true, false), silent);
  EXPECT_GT(before, 0.2);
  EXPECT_LT(degrees_off(capture, truth), 0.25 * before);
  EXPECT_LT(found.error_after, 0.5 * found.error_before);
  EXPECT_GT(found.points.size(), 100u);
  EXPECT_EQ(capture.views[2].world_from_camera, held_out) << "nobody looked at it";
  EXPECT_EQ(capture.views[0].intrinsics, again.views[0].intrinsics) << "lenses were not asked for";
  for (const SparsePoint& point : found.points) EXPECT_THAT(point.views, testing::Not(testing::Contains(2u)));

  const AdjustedCameras second = adjust_cameras(again, learning(true, false), silent);
  EXPECT_EQ(second.points, found.points) << "the same each time";
  for (std::size_t v = 0; v < capture.views.size(); ++v) {
    EXPECT_EQ(again.views[v].world_from_camera, capture.views[v].world_from_camera);
  }
}

TEST(BundleAdjustment, FindsTheFocalLength) {
  Observer silent;
  Capture capture = corner_capture();
  const std::vector<Affined> truth = test::training_poses(capture);
  test::disturb(capture, {.focal = 0.04});
  const AdjustedCameras found = adjust_cameras(capture, learning(true, true), silent);
  for (const View& view : capture.views) EXPECT_NEAR(view.intrinsics.fx, 210, 0.6) << "held out or not";
  EXPECT_NEAR(std::exp(found.moved.lenses.at(0).log_focal), 1 / 1.04, 0.003);
  EXPECT_LT(degrees_off(capture, truth), 0.1);
}

TEST(BundleAdjustment, FindsAForgottenDistortion) {
  Observer silent;
  Intrinsics lens = kPinhole;
  lens.model = LensModel::kOpenCv;
  lens.distortion[0] = -0.15;
  Capture capture = corner_capture(lens);
  test::disturb(capture, {.focal = 0.04});  // which makes it a pinhole
  (void)adjust_cameras(capture, learning(true, true), silent);
  const Intrinsics& found = capture.views[0].intrinsics;
  EXPECT_NEAR(found.fx, 210, 2);
  const auto at = [](const Intrinsics& of) { return ray_direction(of, {10, 10}); };  // a corner of the picture
  EXPECT_LT(length(at(found) - at(lens)), 0.004);
  EXPECT_GT(length(at(kPinhole) - at(lens)), 0.02);
}

TEST(BundleAdjustment, FindsTheFocalLengthOfAFisheye) {
  Observer silent;
  Intrinsics lens = kPinhole;
  lens.model = LensModel::kOpenCvFisheye;
  lens.distortion[0] = 0.03;
  Capture capture = corner_capture(lens);
  test::disturb(capture, {.focal = 0.04});
  (void)adjust_cameras(capture, learning(true, true), silent);
  EXPECT_NEAR(capture.views[0].intrinsics.fx, 210, 1);
  EXPECT_EQ(capture.views[0].intrinsics.distortion, lens.distortion);
}

TEST(BundleAdjustment, LeavesPosesAloneWhereLensesAloneAreAskedFor) {
  Observer silent;
  Capture capture = corner_capture();
  const std::vector<Affined> truth = test::training_poses(capture);
  test::disturb(capture, {.focal = 0.04});
  (void)adjust_cameras(capture, learning(false, true), silent);
  EXPECT_NEAR(capture.views[0].intrinsics.fx, 210, 0.6);
  EXPECT_EQ(test::training_poses(capture), truth);
}

TEST(BundleAdjustment, WhatItReturnsIsWhatItDid) {
  Observer silent;
  Capture capture = corner_capture();
  test::disturb(capture, {.degrees = 0.4, .focal = 0.02});
  Capture given = capture;
  const AdjustedCameras found = adjust_cameras(capture, learning(true, true), silent);
  apply_learned_views(given, found.moved);
  for (std::size_t v = 0; v < capture.views.size(); ++v) {
    EXPECT_EQ(given.views[v].world_from_camera, capture.views[v].world_from_camera);
    EXPECT_EQ(given.views[v].intrinsics, capture.views[v].intrinsics);
  }
}

TEST(BundleAdjustment, LeavesCamerasAloneThatAreRight) {
  Observer silent;
  Capture capture = corner_capture();
  const std::vector<Affined> truth = test::training_poses(capture);
  const AdjustedCameras found = adjust_cameras(capture, learning(true, true), silent);
  EXPECT_TRUE(found.moved.corrections.empty());
  EXPECT_GT(found.evidence, 0);
  EXPECT_EQ(test::training_poses(capture), truth);
  EXPECT_EQ(capture.views[0].intrinsics, kPinhole);
  ASSERT_GT(found.points.size(), 100u) << "which the given cameras show";
  std::vector<double> off;
  for (const SparsePoint& point : found.points) {
    const double to_wall = std::abs(point.position.y - 1.5), to_floor = std::abs(point.position.z);
    off.push_back(std::min(to_wall, to_floor));
  }
  EXPECT_LT(median(off), 0.02);
}

TEST(BundleAdjustment, LeavesBareWallsAlone) {
  Observer silent;
  Capture capture = corner_capture();
  for (View& view : capture.views) std::ranges::fill(view.image.u8, std::uint8_t(99));
  const Affined before = capture.views[0].world_from_camera;
  const AdjustedCameras found = adjust_cameras(capture, learning(true, true), silent);
  EXPECT_TRUE(found.moved.corrections.empty());
  EXPECT_TRUE(found.points.empty());
  EXPECT_EQ(capture.views[0].world_from_camera, before);
}

TEST(BundleAdjustment, IsForThoseWhoLearnCamerasThatNobodyAdjusted) {
  Capture capture = corner_capture();
  EXPECT_FALSE(adjusts_cameras(capture, learning(false, false)));
  EXPECT_TRUE(adjusts_cameras(capture, learning(true, false)));
  EXPECT_TRUE(adjusts_cameras(capture, learning(false, true)));
  capture.points = {{{0, 0, 0}, 1, {0, 1, 2}}};
  EXPECT_FALSE(adjusts_cameras(capture, learning(true, true))) << "who made the points has adjusted the cameras";
}

TEST(BundleAdjustment, EndsWhereTheObserverCancels) {
  struct Impatient : Observer {
    void report_progress(const Progress& progress) override { is_matching |= progress.task == "matches"; }
    [[nodiscard]] bool is_cancelled() const override { return is_matching; }
    bool is_matching = false;
  } observer;
  Capture capture = corner_capture();
  EXPECT_THROW((void)adjust_cameras(capture, learning(true, true), observer), Interrupted);
}

}  // namespace
}  // namespace cnerf::prepare
