#include "src/capture/pose.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/error.h"
#include "tests/capture/fixtures.h"

namespace cnerf {
namespace {

Affined spoiled(double amount) {
  Affined pose = test::ring_pose(1, 5);
  pose.linear.rows[0].x += amount;
  pose.linear.rows[2].y -= amount / 2;
  return pose;
}

TEST(Pose, SmallErrorsAreRepaired) {
  const Affined repaired = rigid_pose(spoiled(4e-3), "a.json", "frames[0]");
  EXPECT_LT(orthonormality_error(repaired.linear), 1e-14);
  EXPECT_NEAR(repaired.linear.determinant(), 1, 1e-14);
  const Mat3d wanted = test::ring_pose(1, 5).linear;
  for (int row = 0; row < 3; ++row) EXPECT_LT(length(repaired.linear.rows[row] - wanted.rows[row]), 6e-3);
}

TEST(Pose, RotationsAreLeftAlone) {
  const Affined pose = test::ring_pose(2, 5);
  const Affined same = rigid_pose(pose, "a.json", "frames[0]");
  for (int row = 0; row < 3; ++row) EXPECT_LT(length(same.linear.rows[row] - pose.linear.rows[row]), 1e-14);
  EXPECT_EQ(same.translation, pose.translation);
}

TEST(Pose, LargeErrorsAreRefused) {
  EXPECT_THROW((void)rigid_pose(spoiled(0.05), "a", "b"), InputError);
}

TEST(Pose, ScaledMirroredSingularAndUndefinedMatricesAreRefused) {
  Affined pose = test::ring_pose(0, 5);
  EXPECT_THROW((void)rigid_pose({pose.linear * 2.0, {}}, "a", "b"), InputError);
  EXPECT_THROW((void)rigid_pose({pose.linear * -1.0, {}}, "a", "b"), InputError);
  EXPECT_THROW((void)rigid_pose({Mat3d{}, {}}, "a", "b"), InputError);
  pose.translation.y = NAN;
  EXPECT_THROW((void)rigid_pose(pose, "a", "b"), InputError);
}

TEST(Pose, QuaternionOfAQuarterTurn) {
  const double h = std::sqrt(0.5);
  const Mat3d turn = rotation_from_quaternion(h, 0, 0, h, "a", "b");  // about +Z
  EXPECT_LT(length(turn * Vec3d{1, 0, 0} - Vec3d{0, 1, 0}), 1e-15);
  EXPECT_THROW((void)rotation_from_quaternion(0, 0, 0, 0, "a", "b"), InputError);
  EXPECT_THROW((void)rotation_from_quaternion(NAN, 0, 0, 1, "a", "b"), InputError);
}

TEST(Pose, OpenGlCamerasLookAlongMinusZ) {
  const Affined camera = opencv_from_opengl_camera({Mat3d::identity(), {1, 2, 3}});
  EXPECT_EQ(camera.direction({0, 0, 1}), (Vec3d{0, 0, -1}));
  EXPECT_EQ(camera.direction({0, 1, 0}), (Vec3d{0, -1, 0}));
  EXPECT_EQ(camera.translation, (Vec3d{1, 2, 3}));
}

}  // namespace
}  // namespace cnerf
