#include "src/prepare/camera_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/rng.h"
#include "src/base/vec3.h"

namespace cnerf::prepare {
namespace {

const cv::Size kPicture(640, 480);

struct Camera {
  Affined world_from_camera;
  double focal = 600;
};

/// The rotation by `angle` about an axis through the camera: 0 = across (tilt), 1 = down (pan), 2 = forward (roll).
Mat3d turn(int axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  if (axis == 0) return {{{1, 0, 0}, {0, c, -s}, {0, s, c}}};
  if (axis == 1) return {{{c, 0, s}, {0, 1, 0}, {-s, 0, c}}};
  return {{{c, -s, 0}, {s, c, 0}, {0, 0, 1}}};
}

cv::Point2f pixel_of(const Camera& camera, Vec3d point) {
  const Vec3d p = camera.world_from_camera.inverse().point(point);
  return {float(camera.focal * p.x / p.z + 320), float(camera.focal * p.y / p.z + 240)};
}

/// Points between `near` and `far` that both cameras see, with `noise` pixels of error.
struct Places {
  std::vector<cv::Point2f> before, after;
};
Places places(const Camera& a, const Camera& b, double near, double far, double noise = 0.3, double wrong = 0) {
  SequentialRng rng(1, 0);
  Places out;
  while (out.before.size() < 200) {
    const double depth = near + (far - near) * rng.uniform();
    const Vec3d point = {(rng.uniform() - 0.5) * depth * 1.2, (rng.uniform() - 0.5) * depth, depth};
    cv::Point2f p = pixel_of(a, point), q = pixel_of(b, point);
    const auto inside = [](cv::Point2f at) { return at.x > 0 && at.y > 0 && at.x < 640 && at.y < 480; };
    if (!inside(p) || !inside(q)) continue;
    q += cv::Point2f(float(noise) * rng.normal(), float(noise) * rng.normal());
    if (rng.uniform() < wrong) q = {640 * rng.uniform(), 480 * rng.uniform()};
    out.before.push_back(p);
    out.after.push_back(q);
  }
  return out;
}

MotionVerdict judge(const Places& p) {
  return judge_motion(p.before, p.after, kPicture);
}

TEST(CameraMotion, TurningOnTheSpotHasNoParallax) {
  for (const int axis : {0, 1, 2}) {
    for (const double focal : {350.0, 600.0, 1500.0}) {
      const double angle = axis == 2 ? 0.2 : 80 / focal;
      const Camera a = {{}, focal}, b = {{turn(axis, angle), {}}, focal};
      EXPECT_EQ(judge(places(a, b, 2, 20)).motion, Motion::kTurned) << axis << " " << focal;
    }
  }
}

TEST(CameraMotion, ZoomingHasNoParallax) {
  const Camera a = {{}, 600}, b = {{turn(1, 0.03), {}}, 780};
  EXPECT_EQ(judge(places(a, b, 2, 20)).motion, Motion::kTurned);
}

TEST(CameraMotion, WrongPlacesDoNotHideATurn) {
  const Camera a = {{}, 600}, b = {{turn(1, 0.12), {}}, 600};
  EXPECT_EQ(judge(places(a, b, 2, 20, 0.3, 0.1)).motion, Motion::kTurned);
}

TEST(CameraMotion, TravellingHasParallax) {
  for (const Vec3d step : {Vec3d{0.5, 0, 0}, Vec3d{0, 0.4, 0}, Vec3d{0, 0, 0.8}}) {
    const Camera a = {}, b = {{Mat3d::identity(), step}, 600};
    EXPECT_EQ(judge(places(a, b, 2.5, 10)).motion, Motion::kParallax) << step.x << step.y << step.z;
  }
}

TEST(CameraMotion, AnOrbitHasParallax) {
  // Turning keeps the subject in the middle: displacements are small, those of near and far things opposite.
  const double angle = 0.15;
  const Camera a = {}, b = {{turn(1, -angle), {4 * std::sin(angle), 0, 4 - 4 * std::cos(angle)}}, 600};
  EXPECT_EQ(judge(places(a, b, 2.5, 7)).motion, Motion::kParallax);
}

TEST(CameraMotion, NothingMovedIsStill) {
  const Camera a;
  EXPECT_EQ(judge(places(a, a, 2, 20)).motion, Motion::kStill);
}

}  // namespace
}  // namespace cnerf::prepare
