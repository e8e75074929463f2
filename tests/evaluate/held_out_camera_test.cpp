/// Cameras of held-out views are found again by a picture's left half, on a scene whose every picture is known.

#include "src/evaluate/held_out_camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/color/colorspace_math.h"
#include "src/evaluate/evaluate.h"
#include "src/picture/encode.h"
#include "tests/evaluate/analytic_engine.h"
#include "tests/evaluate/painted_scene.h"
#include "tests/support/data.h"
#include "tests/support/toy_capture.h"

namespace cnerf {
namespace {

constexpr int kViewWidth = 96, kViewHeight = 72;
const RenderEffort kAll = {0, 1};

/// Looks at the wall from 0.6 sides before it, from somewhat aside.
UnitCamera camera() {
  UnitCamera camera;
  camera.intrinsics = {LensModel::kPinhole, kViewWidth, kViewHeight, 90, 90, 0.5 * kViewWidth, 0.5 * kViewHeight, {}};
  const Affined pose = test::look_at({0.45, 0.62, -0.1}, {0.5, 0.5, 0.5});
  camera.unit_from_camera = pose.linear;
  camera.origin = pose.translation;
  return camera;
}

/// What the engine shows from where the camera really stands, at another exposure.
MonoImage picture_from(const UnitCamera& start, const ViewCorrection& truth) {
  std::vector<Ray> rays;
  for (std::size_t p = 0; p < kViewWidth * kViewHeight; ++p) rays.push_back(truth.applied_to(start.ray_of_pixel(p)));
  std::vector<RayResult> seen(rays.size());
  test::AnalyticEngine().render(rays, {}, kAll, seen);
  MonoImage image;
  image.width = kViewWidth;
  image.height = kViewHeight;
  for (const RayResult& result : seen) {
    const float encoded = srgb_from_linear(result.luminance * truth.gain());
    image.u8.push_back(std::uint8_t(std::lround(255 * encoded)));
  }
  return image;
}

const ViewCorrection kTruth = {0.2f, {0.008f, -0.006f, 0.01f}, {0.006f, 0.004f, -0.005f}};

TEST(HeldOutCamera, IsFoundByTheLeftHalfAndJudgedByTheRight) {
  const test::AnalyticEngine engine;
  const UnitCamera start = camera();
  const auto found = fit_camera({engine, {}}, kAll, start, picture_from(start, kTruth));
  ASSERT_TRUE(found);
  EXPECT_GT(found->psnr, 50) << "rounding to codes leaves 59 dB";
  EXPECT_NEAR(found->correction.log_gain, kTruth.log_gain, 2e-3);
  EXPECT_LT(length(found->correction.turn - kTruth.turn), 1.5e-3f);
  EXPECT_LT(length(found->correction.shift - kTruth.shift), 1.5e-3f);
}

TEST(HeldOutCamera, WhatTheRightHalfShowsIsNotFittedTo) {
  const test::AnalyticEngine engine;
  const UnitCamera start = camera();
  MonoImage image = picture_from(start, kTruth);
  for (int y = 0; y < kViewHeight; ++y) {
    for (int x = kViewWidth / 2; x < kViewWidth; ++x) image.u8[std::size_t(y * kViewWidth + x)] = 255;
  }
  const auto found = fit_camera({engine, {}}, kAll, start, image);
  ASSERT_TRUE(found);
  EXPECT_LT(length(found->correction.turn - kTruth.turn), 1.5e-3f) << "the left half says where it stood";
  EXPECT_LT(found->psnr, 12) << "and the right half is judged";
}

TEST(HeldOutCamera, MaskedPixelsDoNotCount) {
  const test::AnalyticEngine engine;
  const UnitCamera start = camera();
  MonoImage image = picture_from(start, kTruth);
  image.mask.assign(image.pixel_count(), 255);
  for (int y = 0; y < kViewHeight / 3; ++y) {
    for (int x = 0; x < kViewWidth; ++x) {
      image.u8[std::size_t(y * kViewWidth + x)] = 0;
      image.mask[std::size_t(y * kViewWidth + x)] = 0;
    }
  }
  const auto found = fit_camera({engine, {}}, kAll, start, image);
  ASSERT_TRUE(found);
  EXPECT_GT(found->psnr, 50);
  image.mask.assign(image.pixel_count(), 0);
  EXPECT_FALSE(fit_camera({engine, {}}, kAll, start, image)) << "nothing to look at";
}

TEST(HeldOutCamera, FogInTheFirstTenthOfTheWayIsSeen) {
  const test::AnalyticEngine clear, foggy(0.3f);
  UnitCamera inside = camera();
  inside.origin.z = 0.05;  // in the box, whose first tenth the fog lies in
  EXPECT_EQ(near_opacity({clear, {}}, kAll, inside), 0);
  EXPECT_NEAR(near_opacity({foggy, {}}, kAll, inside), 0.3, 1e-6);
}

/// Two training views of three, moved alike.
struct Moved {
  Capture capture = test::toy_capture(3);
  LearnedViews learned;

  explicit Moved(Vec3f shift) {
    capture.views[1].held_out = true;
    learned.frame.unit_per_world = 0.5;
    learned.corrections = {{0.1f, {}, shift}, {-0.1f, {}, shift}};
    apply_learned_views(capture, learned);
  }
};

TEST(HeldOutCamera, HeldOutViewsGoWhereAllOthersWent) {
  const Moved moved({0.01f, -0.02f, 0.03f});
  const auto alignment = alignment_of(moved.capture, moved.learned);
  ASSERT_TRUE(alignment);
  const Affined given = moved.capture.views[1].world_from_camera, there = alignment->applied_to(given);
  EXPECT_LT(length(there.translation - given.translation - Vec3d{0.02, -0.04, 0.06}), 1e-7) << "in world units";
  EXPECT_LT(alignment->median_degrees, 1e-5);
  EXPECT_FALSE(alignment_of(Moved({}).capture, Moved({}).learned)) << "exposures move no camera";
}

TEST(HeldOutCamera, APoseGoesThereAndBack) {
  SceneFrame frame;
  frame.unit_per_world = 0.25;
  const Affined given = test::look_at({1, 2, 3}, {0, 0.5, 0});
  const Affined back = given_pose(corrected_pose(given, kTruth, frame), kTruth, frame);
  EXPECT_LT(length(back.translation - given.translation), 1e-12);
  for (int row = 0; row < 3; ++row) EXPECT_LT(length(back.linear.rows[row] - given.linear.rows[row]), 1e-12);
}

/// A painted picture over the analytic field.
class SceneWithField : public test::PaintedScene {
 public:
  SceneWithField() : PaintedScene(0.4f, false) {}
  [[nodiscard]] std::optional<SeenScene> seen(const RenderOptions&) const override { return SeenScene{engine_, {}}; }

 private:
  test::AnalyticEngine engine_{0.3f};
};

TEST(HeldOutCamera, ColumnsAppearWhereTheyWereAskedFor) {
  const SceneWithField scene;
  const UnitCamera start = camera();
  const test::TempDir folder;
  const std::filesystem::path file = folder / "grey.png";
  write_png(file, Picture{kViewWidth, kViewHeight, std::vector<std::uint8_t>(3 * kViewWidth * kViewHeight, 90)});
  Capture capture;
  for (const bool held_out : {true, false}) {
    View view;
    view.name = held_out ? "held out" : "trained on";
    view.intrinsics = start.intrinsics;
    view.world_from_camera = {start.unit_from_camera, scene.frame().world_from_unit(start.origin)};
    view.image = picture_from(start, {});
    view.image_file = file;
    view.held_out = held_out;
    capture.views.push_back(view);
  }
  EvaluateOptions options;
  const Metrics plain = evaluate(scene, capture, options);
  ASSERT_EQ(plain.views.size(), 1u);
  EXPECT_FALSE(plain.mean.psnr_luminance_aligned);
  EXPECT_TRUE(plain.mean.near_opacity);
  options.alignment = PoseAlignment();
  const Metrics aligned = evaluate(scene, capture, options);
  ASSERT_TRUE(aligned.views[0].psnr_luminance_aligned);
  EXPECT_GT(*aligned.views[0].psnr_luminance_aligned, 50);
  EXPECT_EQ(aligned.mean.psnr_luminance_aligned, aligned.views[0].psnr_luminance_aligned);
  EXPECT_EQ(aligned.mean.psnr_luminance, plain.mean.psnr_luminance) << "no column changes another";
  capture.views[0].held_out = false;
  EXPECT_FALSE(evaluate(scene, capture, options).mean.psnr_luminance_aligned) << "nothing is held out";
}

}  // namespace
}  // namespace cnerf
