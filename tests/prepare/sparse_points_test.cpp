/// Sparse points of a textured plane, whose place is known, and of a real capture.

#include "src/prepare/sparse_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/load_capture.h"
#include "tests/support/data.h"
#include "tests/support/smooth_noise.h"

namespace cnerf::prepare {
namespace {

/// Cameras in a row that look down on the plane z = 0 from two units above.
Capture plane_capture(int views) {
  Capture capture;
  for (int i = 0; i < views; ++i) {
    View view;
    view.name = std::to_string(i);
    view.intrinsics.width = view.image.width = 200;
    view.intrinsics.height = view.image.height = 160;
    view.intrinsics.fx = view.intrinsics.fy = 180;
    view.intrinsics.cx = 100;
    view.intrinsics.cy = 80;
    // x to the right, y down the picture, z along the axis: downwards.
    view.world_from_camera = {Mat3d::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {0.25 * i, 0.1 * (i % 2), 2}};
    for (std::size_t p = 0; p < view.image.pixel_count(); ++p) {
      const PixelPosition pixel{double(p % 200) + 0.5, std::floor(double(p) / 200) + 0.5};
      const Vec3d d = view.world_from_camera.direction(ray_direction(view.intrinsics, pixel));
      const Vec3d at = view.world_from_camera.translation + d * (2 / -d.z);
      view.image.u8.push_back(std::uint8_t(std::lround(255 * test::smooth_noise(at.x, at.y))));
    }
    capture.views.push_back(std::move(view));
  }
  return capture;
}

std::vector<SparsePoint> points_of(const Capture& capture) {
  Observer silent;
  return find_sparse_points(capture, silent);
}

TEST(SparsePoints, LieOnThePlaneThatThePicturesShow) {
  Capture capture = plane_capture(8);
  capture.views[3].held_out = true;
  const std::vector<SparsePoint> points = points_of(capture);
  ASSERT_GT(points.size(), 50u);
  std::vector<double> heights;
  for (const SparsePoint& point : points) {
    EXPECT_GE(point.views.size(), 3u);
    EXPECT_TRUE(std::ranges::is_sorted(point.views));
    EXPECT_EQ(std::ranges::count(point.views, 3u), 0) << "held out";
    EXPECT_LT(point.error, 4);
    heights.push_back(std::abs(point.position.z));
  }
  std::ranges::sort(heights);
  EXPECT_LT(heights[heights.size() / 2], 0.01);
  EXPECT_LT(heights[heights.size() * 9 / 10], 0.05);
  EXPECT_EQ(points_of(capture), points) << "the same each time";
}

TEST(SparsePoints, WrongPosesMakeFew) {
  Capture capture = plane_capture(8);
  const std::size_t right = points_of(capture).size();
  for (std::size_t i = 0; i < 8; ++i) capture.views[i].world_from_camera.translation.y += 0.3 * double(i * i % 5);
  EXPECT_LT(points_of(capture).size(), right / 2);
}

/// Cancels once it has heard of progress so often.
class Impatient : public Observer {
 public:
  explicit Impatient(int patience) : left_(patience) {}
  void report_progress(const Progress& progress) override {
    --left_;
    last_ = progress.task;
  }
  [[nodiscard]] bool is_cancelled() const override { return left_ <= 0; }
  [[nodiscard]] const std::string& last() const { return last_; }

 private:
  int left_;
  std::string last_;
};

TEST(SparsePoints, EndWhereTheObserverCancels) {
  const Capture capture = plane_capture(8);
  for (const auto& [patience, where] : {std::pair(0, ""), std::pair(1, "features"), std::pair(2, "matches")}) {
    Impatient observer(patience);
    EXPECT_THROW((void)find_sparse_points(capture, observer), Interrupted);
    EXPECT_EQ(observer.last(), where);
  }
  const Stage1Options options;
  Impatient observer(1);
  EXPECT_THROW((void)points_for_training({capture, options, "no.snapshot"}, observer), Interrupted);
}

TEST(SparsePoints, AreNotLookedForWhereOutlinesBoundSpaceOrThereAreSome) {
  Observer observer;
  Capture capture = plane_capture(4);
  const Stage1Options options;
  const Stage1Job job{capture, options, "no.snapshot"};
  EXPECT_FALSE(points_for_training(job, observer).empty());
  capture.is_bounded_object = true;
  EXPECT_TRUE(points_for_training(job, observer).empty());
  capture.is_bounded_object = false;
  capture.points = {{{0, 0, 0}, 0.5, {0, 1, 2}}};
  EXPECT_TRUE(points_for_training(job, observer).empty()) << "it has its own";
  capture.points = {{{0, 0, 0}, 0.5, {}}};
  EXPECT_FALSE(points_for_training(job, observer).empty()) << "of which nobody says who sees them";
}

TEST(SparsePoints, ThatFitBadlySayThatCamerasMayBeInexact) {
  struct Listener : Observer {
    void say(const std::string& text) override { said += text; }
    std::string said;
  } exact, inexact;
  Capture capture = plane_capture(8);
  const Stage1Options options;
  EXPECT_FALSE(points_for_training({capture, options, "no.snapshot"}, exact).empty());
  EXPECT_THAT(exact.said, testing::Not(testing::HasSubstr("inexact")));
  for (int i = 0; i < 8; ++i) capture.views[std::size_t(i)].world_from_camera.translation.y += 0.012 * (i * 5 % 7 - 3);
  EXPECT_FALSE(points_for_training({capture, options, "no.snapshot"}, inexact).empty());
  EXPECT_THAT(inexact.said, testing::HasSubstr("stage1.poses=true"));
  inexact.said.clear();
  Stage1Options asked;
  asked.poses = true;
  EXPECT_FALSE(points_for_training({capture, asked, "no.snapshot"}, inexact).empty());
  EXPECT_THAT(inexact.said, testing::Not(testing::HasSubstr("inexact"))) << "they will be learned anyway";
}

TEST(SparsePoints, AreLookedForAgainByATrainingThatGoesOnAndNotByOneThatDoesNotWantThem) {
  Observer observer;
  const Capture capture = plane_capture(4);
  const test::TempDir folder;
  const std::filesystem::path snapshot = folder / "stage1.snapshot";
  write_file(snapshot, std::string_view());
  Stage1Options options;
  const std::vector<SparsePoint> points = points_for_training({capture, options, snapshot, false}, observer);
  EXPECT_FALSE(points.empty());
  EXPECT_EQ(points_for_training({capture, options, snapshot, true}, observer), points);
  options.free_space = false;
  EXPECT_EQ(points_for_training({capture, options, snapshot, false}, observer), points) << "for depths";
  options.depth_weight = 0;
  EXPECT_TRUE(points_for_training({capture, options, snapshot, false}, observer).empty());
}

TEST(SparsePoints, OfARealCapture) {
  CNERF_REQUIRE_DATA(fox, "scenes/fox");
  CaptureOptions options;
  options.downscale = 4;
  options.holdout = 8;
  const Capture capture = load_capture(fox, options);
  const std::vector<SparsePoint> points = points_of(capture);
  EXPECT_GT(points.size(), 1000u);
  for (const SparsePoint& point : points) {
    for (const std::uint32_t view : point.views) ASSERT_FALSE(capture.views[view].held_out);
  }
}

}  // namespace
}  // namespace cnerf::prepare
