#include "src/render/camera_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/capture/arrangement.h"
#include "tests/support/data.h"

namespace cnerf {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;
using testing::HasSubstr;

View view_at(Vec3d position, Vec3d target, Vec3d up = {0, 0, 1}) {
  View view;
  view.name = "images/v" + std::to_string(position.x) + ".png";
  view.intrinsics = {LensModel::kPinhole, 641, 480, 500, 510, 320, 240, {}};
  view.world_from_camera = look_at(position, target, up);
  return view;
}

/// Cameras on a circle of radius 3 and height 1 about (1, 2, 0), looking at its centre.
Capture ring(double begin, double length, int count) {
  Capture capture;
  for (int i = 0; i < count; ++i) {
    const double angle = begin + length * i / count;
    capture.views.push_back(view_at({1 + 3 * std::cos(angle), 2 + 3 * std::sin(angle), 1}, {1, 2, 0}));
  }
  return capture;
}

/// A 5 x 5 wall of cameras in z = 0 looking along +z.
Capture wall() {
  Capture capture;
  for (int y = -2; y <= 2; ++y) {
    for (int x = -2; x <= 2; ++x) {
      const Vec3d position = {0.1 * x, 0.1 * y, 0};
      capture.views.push_back(view_at(position, position + Vec3d{0, 0, 1}, {0, -1, 0}));
    }
  }
  capture.depth_range = DepthRange{2, 8};
  return capture;
}

PictureOptions config_of(int frames) {
  PictureOptions config;
  config.frames = frames;
  config.short_side = 240;
  return config;
}

void expect_near(Vec3d a, Vec3d b, double tolerance) {
  EXPECT_NEAR(length(a - b), 0, tolerance) << a.x << ' ' << a.y << ' ' << a.z;
}

TEST(CameraPathTest, LookAtFollowsTheConventions) {
  const Affined pose = look_at({0, 0, -2}, {0, 0, 0}, {0, -1, 0});
  expect_near(pose.linear.column(0), {1, 0, 0}, 1e-12);
  expect_near(pose.linear.column(1), {0, 1, 0}, 1e-12);
  expect_near(pose.linear.column(2), {0, 0, 1}, 1e-12);
  EXPECT_NEAR(look_at({3, -1, 2}, {0, 1, 0}, {0, 0, 1}).linear.determinant(), 1, 1e-12) << "a rotation, no mirror";
}

TEST(CameraPathTest, TheFocusIsWhereTheAxesMeet) {
  expect_near(arrangement_of(ring(0, kTwoPi, 24)).focus, {1, 2, 0}, 1e-9);
  EXPECT_TRUE(arrangement_of(wall()).forward_facing);
  EXPECT_FALSE(arrangement_of(ring(0, kTwoPi, 24)).forward_facing);
  expect_near(arrangement_of(wall()).focus, {0, 0, 1 / (0.25 / 2 + 0.75 / 8)}, 1e-9);
}

TEST(CameraPathTest, AnOrbitKeepsDistanceAndHeightAndClosesTheCircle) {
  const CameraPath path = orbit_path(ring(0, kTwoPi, 24), config_of(36));
  ASSERT_EQ(path.cameras.size(), 36u);
  double turned = 0;
  for (std::size_t i = 0; i < path.cameras.size(); ++i) {
    const Vec3d from_focus = path.cameras[i].world_from_camera.translation - Vec3d{1, 2, 0};
    EXPECT_NEAR(std::hypot(from_focus.x, from_focus.y), 3, 1e-6);
    EXPECT_NEAR(from_focus.z, 1, 1e-6);
    const Vec3d next = path.cameras[(i + 1) % path.cameras.size()].world_from_camera.translation - Vec3d{1, 2, 0};
    turned += std::atan2(from_focus.x * next.y - from_focus.y * next.x, from_focus.x * next.x + from_focus.y * next.y);
  }
  EXPECT_NEAR(std::abs(turned), kTwoPi, 1e-6);
}

TEST(CameraPathTest, AnOrbitDoesNotEnterAnArcWithoutCameras) {
  const double covered = 2.0;  // radians; the cameras span 2.0 * 23/24
  const CameraPath path = orbit_path(ring(0.5, covered, 24), config_of(50));
  for (const PathCamera& camera : path.cameras) {
    const Vec3d p = camera.world_from_camera.translation - Vec3d{1, 2, 0};
    const double angle = std::atan2(p.y, p.x);
    EXPECT_GE(angle, 0.5 - 1e-3);
    EXPECT_LE(angle, 0.5 + covered + 1e-3);
  }
}

TEST(CameraPathTest, ASwingComesBackByTheSameCameras) {
  const CameraPath path = orbit_path(ring(0.5, 2.0, 24), config_of(50));
  const std::vector<std::vector<std::size_t>> frames = frames_of_equal_cameras(path);
  ASSERT_EQ(frames.size(), 26u) << "both ends are seen once";
  EXPECT_EQ(frames.front(), std::vector<std::size_t>{0});
  EXPECT_EQ(frames[1], (std::vector<std::size_t>{1, 49}));
  EXPECT_EQ(frames.back(), std::vector<std::size_t>{25});
  EXPECT_EQ(frames_of_equal_cameras(orbit_path(ring(0, kTwoPi, 24), config_of(50))).size(), 50u);
}

TEST(CameraPathTest, ASpiralStaysAmongTheCamerasAndLooksAtTheFocus) {
  const Capture capture = wall();
  const CameraPath path = spiral_path(capture, config_of(20));
  const Vec3d focus = arrangement_of(capture).focus;
  double widest = 0;
  for (const PathCamera& camera : path.cameras) {
    const Vec3d p = camera.world_from_camera.translation;
    EXPECT_LE(std::abs(p.x), 0.2);
    EXPECT_LE(std::abs(p.y), 0.2);
    widest = std::max(widest, std::abs(p.x));
    expect_near(camera.world_from_camera.linear.column(2), normalized(focus - p), 1e-9);
  }
  EXPECT_GT(widest, 0.1) << "it moves";
  EXPECT_EQ(turntable_path(capture, config_of(3)).cameras[1].world_from_camera,
            spiral_path(capture, config_of(3)).cameras[1].world_from_camera);
}

TEST(CameraPathTest, PicturesAreSmallEvenAndKeepTheFieldOfView) {
  const Intrinsics lens = orbit_path(ring(0, kTwoPi, 24), config_of(1)).cameras[0].intrinsics;
  EXPECT_EQ(lens.width, 320);
  EXPECT_EQ(lens.height, 240);
  EXPECT_NEAR(lens.fx / lens.width, 500.0 / 641, 1e-9);
  EXPECT_NEAR(lens.fy / lens.height, 510.0 / 480, 1e-9);
}

TEST(CameraPathTest, HeldOutViewsAreTakenAsTheyAre) {
  Capture capture = ring(0, kTwoPi, 8);
  EXPECT_THROW((void)held_out_path(capture), InputError);
  capture.views[3].held_out = true;
  const CameraPath path = held_out_path(capture);
  ASSERT_EQ(path.cameras.size(), 1u);
  EXPECT_EQ(path.cameras[0].intrinsics, capture.views[3].intrinsics);
  EXPECT_EQ(path.cameras[0].name.find('/'), std::string::npos) << "a file name";
}

CameraPath path_of(const std::string& json) {
  const test::TempDir folder;
  write_file(folder / "path.json", json);
  return path_from_file(folder / "path.json");
}

TEST(PathFile, ReadsOpenGlPosesAndBothKindsOfIntrinsics) {
  const CameraPath path = path_of(R"({"w": 64, "h": 48, "camera_angle_x": 1.5707963267948966, "frames": [
    {"transform_matrix": [[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1]]},
    {"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "fl_x": 70, "cx": 30}]})");
  ASSERT_EQ(path.cameras.size(), 2u);
  EXPECT_EQ(path.name, "path");
  EXPECT_NEAR(path.cameras[0].intrinsics.fx, 32, 1e-9);
  expect_near(path.cameras[0].world_from_camera.translation, {5, 6, 7}, 1e-12);
  expect_near(path.cameras[0].world_from_camera.linear.column(2), {0, 0, -1}, 1e-12);
  EXPECT_EQ(path.cameras[1].intrinsics.fx, 70);
  EXPECT_EQ(path.cameras[1].intrinsics.cx, 30);
}

TEST(PathFile, ErrorsNameFileAndField) {
  const auto message_for = [](const std::string& json) -> std::string {
    try {
      (void)path_of(json);
    } catch (const InputError& error) {
      return error.what();
    }
    return "(accepted)";
  };
  const std::string start = R"({"w": 64, "h": 48, "fl_x": 50, "frames": [{"transform_matrix": )";
  EXPECT_THAT(message_for("{"), HasSubstr("path.json"));
  EXPECT_THAT(message_for("{\"frames\": []}"), HasSubstr("frames"));
  EXPECT_THAT(message_for(R"({"frames": [{}]})"), HasSubstr("frames[0].w, h"));
  EXPECT_THAT(message_for(R"({"w": 9, "h": 9, "frames": [{}]})"), HasSubstr("frames[0].fl_x"));
  const std::string there = "[[1,0,0,0],[0,1,0,0],[0,0,1,0]]";
  EXPECT_EQ(message_for(start + there + "}]}"), "(accepted)");
  EXPECT_THAT(message_for(start + there + R"(, "cx": -1e308}]})"), HasSubstr("frames[0].principal point"));
  EXPECT_THAT(message_for(start + there + R"(, "fl_y": 1e-9}]})"), HasSubstr("frames[0].focal length"));
  EXPECT_THAT(message_for(start + "[[1,0,0,1e10],[0,1,0,0],[0,0,1,0]]}]}"), HasSubstr("frames[0].position"));
  EXPECT_THAT(message_for(start + "[[1,0,0],[0,1,0],[0,0,1]]}]}"), HasSubstr("frames[0].transform_matrix"));
  EXPECT_THAT(message_for(start + "[[2,0,0,0],[0,1,0,0],[0,0,1,0]]}]}"), HasSubstr("not orthonormal"));
  EXPECT_THAT(message_for(start + "[[-1,0,0,0],[0,1,0,0],[0,0,1,0]]}]}"), HasSubstr("mirrored"));
  EXPECT_THAT(message_for(start + "[[1,0,0,0],[0,1,0,0],[0,0,1,\"x\"]]}]}"), HasSubstr("expected numbers"));
  EXPECT_THROW((void)path_from_file("/absent/path.json"), MissingInputError);
}

}  // namespace
}  // namespace cnerf
