// Where the field's box lies.

#include "src/train/luminance/placement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "src/base/error.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

TEST(Placement, TakesTheCentreThatIsGiven) {
  const Capture capture = test::toy_capture(6);
  const SceneFrame chosen = place_scene(capture, {});
  const SceneFrame given = place_scene(capture, {.cascades = 2, .centre = "1,-2.5,3e-1"});
  EXPECT_EQ(given.world_centre.x, 1);
  EXPECT_EQ(given.world_centre.y, -2.5);
  EXPECT_EQ(given.world_centre.z, 0.3);
  EXPECT_EQ(given.cascades, 2);
  EXPECT_EQ(given.unit_per_world, chosen.unit_per_world);
  for (const char* text : {"1,2", "1,2,x", "1,2,3,4", "1 2 3", "nan,0,0", "0,inf,0", "0,0,1e999"}) {
    EXPECT_THROW((void)place_scene(capture, {.cascades = 0, .centre = text}), UsageError) << text;
  }
}

View view_at(Vec3d eye, Vec3d target) {
  View view;
  view.intrinsics = {LensModel::kPinhole, 24, 20, 29, 29, 12, 10, {}};
  view.world_from_camera = test::look_at(eye, target);
  return view;
}

/// Cameras side by side, whose axes diverge a little.
Capture wall() {
  Capture capture;
  for (int i = -3; i <= 3; ++i) capture.views.push_back(view_at({0, 0.1 * i, 0}, {3, 0.12 * i, 0.01 * i}));
  return capture;
}

TEST(Placement, OfCamerasSideBySideKnowsNoUnitOfLength) {
  const auto placed = [](double scale) {
    Capture capture;
    for (int i = -3; i <= 3; ++i) {
      capture.views.push_back(view_at(Vec3d{0, 0.1 * i, 0} * scale, Vec3d{3, 0.1 * i, 0} * scale));
    }
    return place_scene(capture, {});
  };
  const SceneFrame small = placed(1), large = placed(100);
  EXPECT_NEAR(100 * large.unit_per_world, small.unit_per_world, 1e-6 * small.unit_per_world);
  EXPECT_NEAR(length(large.world_centre - 100.0 * small.world_centre), 0, 1e-6);
  EXPECT_EQ(large.cascades, small.cascades);
}

/// Cameras on a circle that look outward, as from the middle of a room.
Capture outward_ring() {
  Capture capture;
  for (int i = 0; i < 8; ++i) {
    const Vec3d outward = {std::cos(0.25 * i * std::numbers::pi), std::sin(0.25 * i * std::numbers::pi), 0};
    capture.views.push_back(view_at(0.5 * outward, 3.0 * outward));
  }
  return capture;
}

double reach_of(const SceneFrame& frame, Vec3d from, Vec3d towards) {
  return double(intersect(frame.world_box(), from, towards).value_or(Interval<double>{}).end);
}

TEST(Placement, HoldsWhatPointsShowBeforeTheCameras) {
  Capture capture = wall();
  for (int i = 0; i < 100; ++i) capture.points.push_back({{3 + 0.06 * i, 1 - 0.02 * i, 0.3}, 0.5, {}});
  capture.points.push_back({{500, 0, 0}, 0.5, {}});  // an outlier
  const SceneFrame frame = place_scene(capture, {});
  for (int i = 0; i < 98; ++i) EXPECT_TRUE(frame.world_box().contains(capture.points[i].position)) << i;
  EXPECT_TRUE(frame.world_box().contains({0, 0, 0})) << "and the cameras";
  EXPECT_LT(reach_of(frame, {0, 0, 0}, {1, 0, 0}), 14);
  capture.points.clear();
  EXPECT_GT(reach_of(place_scene(capture, {}), {0, 0, 0}, {1, 0, 0}), 2) << "nothing tells: some times their spread";
}

TEST(Placement, HoldsAllThatManyCamerasPassBy) {
  // A front that cameras pass along, a field that is flown over, and a corridor that is walked through.
  for (const Vec3d along : {Vec3d{0, 1, 0}, Vec3d{0, 0.7, 0.7}, Vec3d{1, 0.05, 0}}) {
    Capture capture;
    for (int i = 0; i <= 30; ++i) {
      const Vec3d eye = along * double(i);
      capture.views.push_back(view_at(eye, eye + Vec3d{5, 0.02 * (i % 5), 0.01 * (i % 3)}));
      for (const double side : {-1.0, 1.0}) capture.points.push_back({eye + Vec3d{5, side, 0.5}, 0.5, {}});
    }
    const Aabbd box = place_scene(capture, {}).world_box();
    const auto held = std::ranges::count_if(capture.points, [&](const auto& p) { return box.contains(p.position); });
    EXPECT_GE(held, std::ssize(capture.points) * 95 / 100);
    for (const View& view : capture.views) EXPECT_TRUE(box.contains(view.world_from_camera.translation));
  }
}

TEST(Placement, OfPointsThatAreFoundLaterIsThatOfTheCaptureWithThem) {
  Capture capture = wall();
  std::vector<SparsePoint> points;
  for (int i = 0; i < 100; ++i) points.push_back({{3 + 0.06 * i, 0, 0}, 0.5, {}});
  const SceneFrame later = place_scene(capture, {}, points);
  capture.points = points;
  EXPECT_EQ(later, place_scene(capture, {}));
}

TEST(Placement, OfCamerasBeforeAnObjectStaysAroundItWhereNoPointTellsMore) {
  Capture capture;
  for (int i = -3; i <= 3; ++i) capture.views.push_back(view_at({0, 0.3 * i, 0}, {3, 0, 0}));
  EXPECT_NEAR(length(place_scene(capture, {}).world_centre - Vec3d{3, 0, 0}), 0, 1e-6);
}

TEST(Placement, HoldsTheWallsOfARoomThatIsSeenFromWithin) {
  Capture capture = outward_ring();
  EXPECT_GT(reach_of(place_scene(capture, {}), {0, 0, 0}, {1, 0, 0}), 3) << "nothing tells: some times their spread";
  for (int i = 0; i < 64; ++i) {
    const double angle = 0.1 * i;
    capture.points.push_back({{3 * std::cos(angle), 3 * std::sin(angle), 0.1 * (i % 5)}, 0.5, {}});
  }
  const SceneFrame frame = place_scene(capture, {});
  for (const SparsePoint& point : capture.points) EXPECT_TRUE(frame.world_box().contains(point.position));
  EXPECT_LT(reach_of(frame, {0, 0, 0}, {1, 0, 0}), 4);
}

TEST(Placement, OfAnObjectKnowsNoSilhouetteThatIsHeldOut) {
  Capture capture;
  capture.is_bounded_object = true;
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.25 * i * std::numbers::pi;
    View& view = capture.views.emplace_back(view_at({3 * std::cos(angle), 3 * std::sin(angle), 0}, {0, 0, 0}));
    view.image.width = view.intrinsics.width, view.image.height = view.intrinsics.height;
    view.image.alpha.assign(view.image.pixel_count(), 0);
    for (const int row : {9, 10}) view.image.alpha[std::size_t(row) * 24 + 12] = 255;
  }
  View& view = capture.views[2];
  view.held_out = true;
  const SceneFrame frame = place_scene(capture, {});
  view.image.alpha.assign(view.image.pixel_count(), 0);
  EXPECT_EQ(place_scene(capture, {}), frame);
  view.held_out = false;
  EXPECT_FALSE(place_scene(capture, {}) == frame) << "the measure can fail";
}

/// Eight cameras around a block that bears a pole, one pixel wide.
Capture block_with_pole(Vec3d pole) {
  constexpr int kSide = 400;
  Capture capture;
  capture.is_bounded_object = true;
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.25 * i * std::numbers::pi;
    View& view = capture.views.emplace_back(view_at({3 * std::cos(angle), 3 * std::sin(angle), 0}, {0, 0, 0}));
    view.intrinsics = {LensModel::kPinhole, kSide, kSide, 420, 420, 0.5 * kSide, 0.5 * kSide, {}};
    view.image.width = view.image.height = kSide;
    view.image.alpha.assign(view.image.pixel_count(), 0);
    for (int y = 180; y < 280; ++y) {
      for (int x = 160; x < 240; ++x) view.image.alpha[std::size_t(y) * kSide + std::size_t(x)] = 255;
    }
    for (double z = 0; z < 0.9; z += 0.002) {
      const auto pixel = project(view.intrinsics, view.world_from_camera.inverse().point({pole.x, pole.y, z}));
      if (pixel) view.image.alpha[std::size_t(pixel->y) * kSide + std::size_t(pixel->x)] = 255;
    }
  }
  return capture;
}

TEST(Placement, OfAnObjectHoldsWhatIsThin) {
  for (int i = 0; i < 12; ++i) {
    const Vec3d pole = {0.03 + 0.0071 * i, 0.012 - 0.0053 * i, 0.88};
    const Aabbd box = place_scene(block_with_pole(pole), {}).world_box();
    EXPECT_TRUE(box.contains(pole)) << i;
    EXPECT_TRUE(box.contains({0, 0, -0.45}));
    EXPECT_LT(box.size().z, 2) << "and little else";
  }
}

TEST(Placement, OfAnObjectIsToldNothingByPixelsThatAreIgnored) {
  Capture capture = block_with_pole({0.03, 0.012, 0});
  MonoImage& image = capture.views[2].image;
  image.alpha.assign(image.pixel_count(), 0);
  image.mask.assign(image.pixel_count(), 0);
  const SceneFrame frame = place_scene(capture, {});
  capture.views[2].held_out = true;
  EXPECT_EQ(place_scene(capture, {}), frame);
  capture.views[2].held_out = false;
  image.mask.assign(image.pixel_count(), 255);
  EXPECT_FALSE(place_scene(capture, {}) == frame) << "the measure can fail";
}

TEST(Placement, RefusesCamerasThatStandInOnePlace) {
  for (const Vec3d place : {Vec3d{0, 0, 0}, Vec3d{0.3, 0.7, 0.7}}) {
    Capture capture;
    for (int i = 0; i < 8; ++i) {
      const Vec3d towards = {std::cos(double(i)), std::sin(double(i)), 0.2};
      capture.views.push_back(view_at(place, place + towards));
    }
    EXPECT_THROW((void)place_scene(capture, {}), InputError);
  }
}

}  // namespace
}  // namespace cnerf
