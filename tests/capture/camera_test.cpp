#include "src/capture/camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/error.h"

namespace cnerf {
namespace {

Intrinsics camera(LensModel model, std::array<double, 8> distortion) {
  return {model, 1080, 1920, 1375.52, 1374.49, 554.558, 965.268, distortion};
}

struct Lens {
  const char* name;
  Intrinsics intrinsics;
};
void PrintTo(const Lens& lens, std::ostream* out) {
  *out << lens.name;
}
class Lenses : public testing::TestWithParam<Lens> {};
INSTANTIATE_TEST_SUITE_P(
    All, Lenses,
    testing::Values(Lens{"pinhole", camera(LensModel::kPinhole, {})},
                    Lens{"phone", camera(LensModel::kOpenCv, {0.0578421, -0.0805099, -0.000980296, 0.00015575})},
                    Lens{"barrel", camera(LensModel::kOpenCv, {-0.12, 0.01, 0.001, -0.002, 0.003})},
                    Lens{"rational", camera(LensModel::kOpenCv, {0.3, 0.05, 0.001, 0.002, 0.01, 0.25, 0.02, 0.003})},
                    Lens{"fisheye", camera(LensModel::kOpenCvFisheye, {-0.02, 0.004, -0.003, 0.0005})},
                    Lens{"equidistant", camera(LensModel::kOpenCvFisheye, {})}),
    [](const auto& name_of) { return name_of.param.name; });

TEST_P(Lenses, ProjectionInvertsTheRayAllOverTheImage) {
  const Intrinsics& intrinsics = GetParam().intrinsics;
  for (double y = 0; y <= intrinsics.height; y += 60) {
    for (double x = 0; x <= intrinsics.width; x += 60) {
      const Vec3d direction = ray_direction(intrinsics, {x, y});
      ASSERT_NEAR(length(direction), 1, 1e-14);
      const auto back = project(intrinsics, direction * 3.7);
      ASSERT_TRUE(back);
      ASSERT_NEAR(back->x, x, 1e-8);
      ASSERT_NEAR(back->y, y, 1e-8);
    }
  }
}

TEST_P(Lenses, PrincipalPointLooksAlongTheAxis) {
  const Intrinsics& intrinsics = GetParam().intrinsics;
  const Vec3d axis = ray_direction(intrinsics, {intrinsics.cx, intrinsics.cy});
  EXPECT_NEAR(length(axis - Vec3d{0, 0, 1}), 0, 1e-12);
}

TEST_P(Lenses, PointsBehindTheCameraAreNowhere) {
  EXPECT_FALSE(project(GetParam().intrinsics, {0.1, 0.1, -1}));
  EXPECT_FALSE(project(GetParam().intrinsics, {0.1, 0.1, 0}));
}

TEST_P(Lenses, ResizingCommutesWithProjection) {
  const Intrinsics& intrinsics = GetParam().intrinsics;
  const Intrinsics half = resized(intrinsics, 540, 960);
  const Vec3d point = {0.2, -0.3, 1};
  EXPECT_NEAR(project(half, point)->x, project(intrinsics, point)->x / 2, 1e-9);
  EXPECT_NEAR(project(half, point)->y, project(intrinsics, point)->y / 2, 1e-9);
  EXPECT_EQ(half.width, 540);
  EXPECT_EQ(half.height, 960);
}

TEST(Camera, AxesAreRightDownForward) {
  const Intrinsics intrinsics = camera(LensModel::kPinhole, {});
  const Vec3d corner = ray_direction(intrinsics, {1080, 1920});
  EXPECT_GT(corner.x, 0);
  EXPECT_GT(corner.y, 0);
  EXPECT_GT(corner.z, 0);
}

TEST(Camera, DistortionFollowsOpenCvsFormula) {
  // k1 k2 p1 p2 k3 k4 k5 k6 at (0.3, -0.2), worked out by hand from the formula of OpenCV's calib3d page.
  const std::array<double, 8> d = {0.1, -0.05, 0.002, -0.003, 0.01, 0.04, 0.02, -0.01};
  const Intrinsics intrinsics = {LensModel::kOpenCv, 100, 100, 1, 1, 0, 0, d};
  const double x = 0.3, y = -0.2, s = 0.13;
  const double radial =
      (1 + 0.1 * s - 0.05 * s * s + 0.01 * s * s * s) / (1 + 0.04 * s + 0.02 * s * s - 0.01 * s * s * s);
  const auto pixel = project(intrinsics, {x, y, 1});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, x * radial + 2 * 0.002 * x * y + -0.003 * (s + 2 * x * x), 1e-15);
  EXPECT_NEAR(pixel->y, y * radial + 0.002 * (s + 2 * y * y) + 2 * -0.003 * x * y, 1e-15);
}

TEST(Camera, FisheyeIsAPolynomialOfTheAngle) {
  const Intrinsics intrinsics = {LensModel::kOpenCvFisheye, 100, 100, 10, 10, 50, 50, {0.1, 0.01, 0.001, 0.0001}};
  const double t = 0.8;
  const auto pixel = project(intrinsics, {std::sin(t), 0, std::cos(t)});
  ASSERT_TRUE(pixel);
  const double s = t * t;
  EXPECT_NEAR(pixel->x, 50 + 10 * t * (1 + 0.1 * s + 0.01 * s * s + 0.001 * s * s * s + 0.0001 * s * s * s * s), 1e-12);
}

TEST(Camera, PointsBeyondTheFoldOfTheLensAreNowhere) {
  const Intrinsics intrinsics = camera(LensModel::kOpenCv, {-0.4});  // folds at r^2 = 1 / (3 * 0.4)
  EXPECT_TRUE(project(intrinsics, {0.9, 0, 1}));
  EXPECT_FALSE(project(intrinsics, {0.93, 0, 1}));
  EXPECT_FALSE(project(intrinsics, {1.6, 0, 1}));
}

TEST(Camera, ResizingNeedsASize) {
  EXPECT_THROW((void)resized(camera(LensModel::kPinhole, {}), 0, 10), ContractError);
  EXPECT_THROW((void)resized(Intrinsics{}, 10, 10), ContractError);
}

}  // namespace
}  // namespace cnerf
