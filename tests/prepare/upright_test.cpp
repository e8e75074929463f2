#include "src/prepare/upright.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "src/base/error.h"
#include "src/base/rng.h"
#include "tests/prepare/random_similarity.h"

namespace cnerf::prepare {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// A camera at `eye` that looks at `target`, held level about `up`.
Affined level_camera(Vec3d eye, Vec3d target, Vec3d up) {
  const Vec3d forward = normalized(target - eye), right = normalized(cross(forward, up));
  return {Mat3d::from_columns(right, cross(forward, right), forward), eye};
}

View view_of(const Affined& pose, const std::string& name) {
  View view;
  view.name = name;
  view.intrinsics = {LensModel::kPinhole, 640, 480, 600, 600, 320, 240, {}};
  view.world_from_camera = pose;
  return view;
}

/// Cameras around the origin at a pitch of 30 degrees down, Z-up.
std::vector<View> orbit(int count, double part = 1) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * part * i / count;
    const Vec3d eye = {3 * std::cos(angle), 3 * std::sin(angle), 1.7};
    views.push_back(view_of(level_camera(eye, {0, 0, 0}, {0, 0, 1}), "v" + std::to_string(i) + ".png"));
  }
  return views;
}

/// A floor at z = -0.5 under a cloud of an object.
std::vector<Vec3d> floor_and_object(SequentialRng& rng, int floor_points = 300, int object_points = 300) {
  std::vector<Vec3d> points;
  for (int i = 0; i < floor_points; ++i) {
    points.push_back({2 * rng.uniform() - 1.0, 2 * rng.uniform() - 1.0, -0.5 + 0.002 * rng.normal()});
  }
  for (int i = 0; i < object_points; ++i) {
    points.push_back({0.6 * rng.uniform() - 0.3, 0.6 * rng.uniform() - 0.3, 0.8 * rng.uniform() - 0.45});
  }
  return points;
}

double degrees_between(Vec3d a, Vec3d b) {
  return std::acos(std::min(1.0, dot(normalized(a), normalized(b)))) / kDegree;
}

void move(const Similarity& s, std::vector<View>& views, std::vector<Vec3d>& points) {
  for (View& view : views) view.world_from_camera = s.pose(view.world_from_camera);
  for (Vec3d& point : points) point = s.point(point);
}

TEST(UpFromCameras, LevelCamerasTellUpExactlyWhateverTheyLookAt) {
  SequentialRng rng(1, 0);
  const Vec3d up = normalized(test::random_vector(rng));
  std::vector<Affined> poses;
  for (int i = 0; i < 20; ++i) {
    // Looking down by different angles: the mean of the pictures' tops would be off by degrees.
    poses.push_back(level_camera(test::random_vector(rng) * 3.0 + up * 4.0, test::random_vector(rng), up));
  }
  const UpFromCameras found = up_from_cameras(poses);
  EXPECT_TRUE(found.from_axes);
  EXPECT_LT(degrees_between(found.up, up), 1e-5);
}

TEST(UpFromCameras, ForwardFacingCamerasTellByTheirTops) {
  std::vector<Affined> poses;
  for (int i = 0; i < 10; ++i) poses.push_back(level_camera({0.1 * i, 0, 0}, {0.1 * i, 5, 0}, {0, 0, 1}));
  const UpFromCameras found = up_from_cameras(poses);
  EXPECT_FALSE(found.from_axes);
  EXPECT_LT(degrees_between(found.up, {0, 0, 1}), 1e-6);
}

TEST(FindGround, FindsAFloorUnderAnObject) {
  SequentialRng rng(2, 0);
  const auto ground = find_ground(floor_and_object(rng), normalized(Vec3d{0.2, -0.1, 1}));
  ASSERT_TRUE(ground);
  EXPECT_LT(degrees_between(ground->normal, {0, 0, 1}), 0.5);
  EXPECT_NEAR(ground->height, -0.5, 0.005);
}

TEST(FindGround, ACeilingOrAWallIsNoGround) {
  SequentialRng rng(3, 0);
  const std::vector<Vec3d> points = floor_and_object(rng);
  EXPECT_FALSE(find_ground(points, {0, 0, -1})) << "seen from below, all points lie under the plane";
  EXPECT_FALSE(find_ground(points, {1, 0, 0})) << "square to up";
}

TEST(FindGround, ACloudHasNone) {
  SequentialRng rng(4, 0);
  std::vector<Vec3d> cloud;
  for (int i = 0; i < 600; ++i) cloud.push_back(test::random_vector(rng));
  EXPECT_FALSE(find_ground(cloud, {0, 0, 1}));
}

TEST(ChooseFrame, SetsAnyTurnedSceneUpright) {
  SequentialRng rng(5, 0);
  for (int trial = 0; trial < 10; ++trial) {
    std::vector<View> views = orbit(24);
    std::vector<Vec3d> points = floor_and_object(rng);
    const Similarity moved = test::random_similarity(rng);
    move(moved, views, points);
    const FrameChoice choice = choose_frame(views, points, {});
    EXPECT_EQ(choice.up_by, "ground");
    const Vec3d up = choice.capture_from_poses.rotation * (moved.rotation * Vec3d{0, 0, 1});
    EXPECT_LT(degrees_between(up, {0, 0, 1}), 0.5);
    const Vec3d on_floor = choice.capture_from_poses.point(moved.point({0.4, 0.3, -0.5}));
    EXPECT_NEAR(on_floor.z, 0, 0.01);
    double distance = 0;
    for (const View& view : views) {
      distance += length(choice.capture_from_poses.point(view.world_from_camera.translation) -
                         choice.capture_from_poses.point(moved.point({0, 0, 0}))) /
                  double(views.size());
    }
    EXPECT_NEAR(distance, 1, 0.02) << "cameras stand one unit from what they look at";
  }
}

TEST(ChooseFrame, TakesWhatTheUserSays) {
  SequentialRng rng(6, 0);
  const std::vector<View> views = orbit(24);
  const std::vector<Vec3d> points = floor_and_object(rng);
  FrameOptions options;
  options.up = "1,0,0";
  options.scale = 5;
  const FrameChoice given = choose_frame(views, points, options);
  EXPECT_LT(length(given.capture_from_poses.rotation * Vec3d{1, 0, 0} - Vec3d{0, 0, 1}), 1e-12);
  EXPECT_EQ(given.capture_from_poses.scale, 5);
  options.up = "none";
  options.scale = 0;
  EXPECT_LT(length(choose_frame(views, points, options).capture_from_poses.point({1, 2, 3}) - Vec3d{1, 2, 3}), 1e-12);
  options.up = "sideways";
  EXPECT_THROW((void)choose_frame(views, points, options), UsageError);
}

TEST(Triangulate, MeetsWhereRaysMeet) {
  SequentialRng rng(7, 0);
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3d truth = test::random_vector(rng);
    std::vector<WorldRay> rays;
    for (int i = 0; i < 2 + trial % 4; ++i) {
      const Vec3d origin = test::random_vector(rng) * 5.0;
      rays.push_back({origin, normalized(truth - origin)});
    }
    const Triangulated found = triangulate(rays);
    EXPECT_LT(length(found.point - truth), 1e-6);
    EXPECT_LT(found.distance, 1e-7);
  }
}

TEST(Triangulate, SkewRaysMeetHalfway) {
  const Triangulated found = triangulate({{{0, 0, 0}, {1, 0, 0}}, {{0, 0, 2}, {0, 1, 0}}});
  EXPECT_LT(length(found.point - Vec3d{0, 0, 1}), 1e-12);
  EXPECT_NEAR(found.distance, 1, 1e-12);
  EXPECT_NEAR(found.widest_degrees, 90, 1e-9);
}

TEST(Triangulate, ParallelRaysAreRefused) {
  EXPECT_THROW((void)triangulate({{{0, 0, 0}, {1, 0, 0}}, {{0, 1, 0}, {1, 0, 0}}}), InputError);
}

std::string sighting(const View& view, Vec3d point) {
  const auto pixel = project(view.intrinsics, view.world_from_camera.inverse().point(point));
  return std::to_string(pixel->x) + "," + std::to_string(pixel->y) + "," + view.name;
}

TEST(Measure, TwoViewsOfEachEndGiveTheLength) {
  const std::vector<View> views = orbit(24);
  const Vec3d a = {0.2, 0.1, 0}, b = {-0.3, 0.2, 0.3};
  const std::string text = sighting(views[0], a) + "+" + sighting(views[5], a) + " " + sighting(views[2], b) + "+" +
                           sighting(views[8], b) + " = ";
  EXPECT_NEAR(units_per_metre(text + "1.2m", views, {}), length(a - b) / 1.2, 1e-4);  // six decimals of a pixel
  EXPECT_NEAR(units_per_metre(text + "120cm", views, {}), length(a - b) / 1.2, 1e-4);
}

TEST(Measure, OneViewTakesDepthFromPointsAround) {
  SequentialRng rng(8, 0);
  const std::vector<View> views = orbit(24);
  std::vector<Vec3d> floor;
  for (int i = 0; i < 2000; ++i) floor.push_back({2 * rng.uniform() - 1.0, 2 * rng.uniform() - 1.0, 0});
  const Vec3d a = {0.4, 0.1, 0}, b = {-0.4, 0.2, 0};
  const std::string text = sighting(views[0], a) + " " + sighting(views[3], b) + " = 2m";
  EXPECT_NEAR(units_per_metre(text, views, floor) / (length(a - b) / 2), 1, 0.1);  // the nearer of the points around
}

TEST(Measure, MakesTheSceneMetric) {
  SequentialRng rng(9, 0);
  std::vector<View> views = orbit(24);
  std::vector<Vec3d> points = floor_and_object(rng);
  Vec3d a = {0.2, 0.1, 0}, b = {-0.3, 0.2, 0.3};
  const Similarity moved = test::random_similarity(rng);
  move(moved, views, points);
  a = moved.point(a), b = moved.point(b);
  FrameOptions options;
  options.measure = sighting(views[0], a) + "+" + sighting(views[5], a) + " " + sighting(views[2], b) + "+" +
                    sighting(views[8], b) + " = 0.8m";
  const FrameChoice choice = choose_frame(views, points, options);
  EXPECT_TRUE(choice.metres);
  EXPECT_NEAR(length(choice.capture_from_poses.point(a) - choice.capture_from_poses.point(b)), 0.8, 1e-4);
}

TEST(Measure, RefusesWhatItCannotUse) {
  const std::vector<View> views = orbit(4);
  EXPECT_THROW((void)units_per_metre("10,10 20,20 = 1m", views, {}), UsageError);
  EXPECT_THROW((void)units_per_metre("10,10,nobody 20,20,v1 = 1m", views, {}), UsageError);
  EXPECT_THROW((void)units_per_metre("10,10,v0 20,20,v1 = 0m", views, {}), UsageError);
  EXPECT_THROW((void)units_per_metre("10,10,v0 20,20,v1 = .m", views, {}), UsageError);
  EXPECT_THROW((void)units_per_metre("10,10,v0 20,20,v1 = 1.2.3m", views, {}), UsageError);
  EXPECT_THROW((void)units_per_metre("10,.,v0 20,20,v1 = 1m", views, {}), UsageError);
  EXPECT_THROW((void)units_per_metre("9999,10,v0 20,20,v1 = 1m", views, {}), UsageError);
  EXPECT_THROW((void)units_per_metre("10,10,v0 20,20,v1 = 1m", views, {}), InputError) << "no points, no depth";
}

TEST(FrameTexts, AreReadBeforeThereAreViews) {
  FrameOptions options;
  EXPECT_NO_THROW(check_texts(options));
  options.up = "0,0,1";
  options.measure = "10,10,v0+11,12,v2 20,20,v1 = 1.2m";
  options.box = "0,0,0 1,1,1";
  EXPECT_NO_THROW(check_texts(options));
  const auto refused = [&](std::string FrameOptions::*text, const char* bad) {
    FrameOptions changed = options;
    changed.*text = bad;
    EXPECT_THROW(check_texts(changed), UsageError) << bad;
  };
  refused(&FrameOptions::up, "sideways");
  refused(&FrameOptions::up, "0,0,inf");
  refused(&FrameOptions::measure, "10,10,v0 20,20,v1 = .m");
  refused(&FrameOptions::measure, "10,10 20,20 = 1m");
  refused(&FrameOptions::box, "1,2,3");
}

TEST(FindSubject, BoxHoldsTheObjectAndNotTheOutliers) {
  SequentialRng rng(10, 0);
  std::vector<Vec3d> points = floor_and_object(rng);
  for (int i = 0; i < 20; ++i) points.push_back(test::random_vector(rng) * 100.0);
  const auto subject = find_subject(orbit(24), points);
  ASSERT_TRUE(subject);
  EXPECT_FALSE(subject->forward_facing);
  EXPECT_TRUE(subject->box.contains({0.29, 0.29, 0.3}));
  EXPECT_TRUE(subject->box.contains({0, 0, -0.5}));
  EXPECT_LT(length(subject->box.size()), 4);
}

TEST(FindSubject, ForwardFacingViewsGetADepthRange) {
  SequentialRng rng(11, 0);
  std::vector<View> views;
  for (int i = 0; i < 10; ++i) {
    views.push_back(view_of(level_camera({0.1 * i, 0, 0}, {0.1 * i, 5, 0}, {0, 0, 1}), std::to_string(i)));
  }
  std::vector<Vec3d> points;
  for (int i = 0; i < 500; ++i)
    points.push_back({rng.uniform() * 2.0 - 0.5, 4 + 4.0 * rng.uniform(), rng.uniform() - 0.5});
  const auto subject = find_subject(views, points);
  ASSERT_TRUE(subject);
  EXPECT_TRUE(subject->forward_facing);
  EXPECT_NEAR(subject->near, 0.9 * 4, 0.1);
  EXPECT_NEAR(subject->far, 1.1 * 8, 0.1);
}

TEST(Box, IsReadFromItsCornersInAnyOrder) {
  const Aabbd box = parse_box("1,-2,0.5 -1,2,0");
  EXPECT_EQ(box.min, (Vec3d{-1, -2, 0}));
  EXPECT_EQ(box.max, (Vec3d{1, 2, 0.5}));
  for (const char* bad : {"", "1,2,3", "1,2,3 1,4,5", "0,0,0 1,1,1 x", "0,0,0 1,1,nan", "a,b,c d,e,f"}) {
    EXPECT_THROW((void)parse_box(bad), UsageError) << bad;
  }
}

}  // namespace
}  // namespace cnerf::prepare
