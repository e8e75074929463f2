#include "bake/density/levels.h"

#include <gtest/gtest.h>

#include <functional>
#include <numbers>

#include "bake/volume/integrate.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/whole_bake.h"

namespace cnerf::bake::test {
namespace {

/// A lattice of 12 voxels along each axis, 1 world unit each.
Level level_of(const std::function<float(Vec3i)>& density) {
  Plan plan;
  plan.voxel_size = 1;
  plan.resolution = {12, 12, 12};
  plan.box = {{0, 0, 0}, {12, 12, 12}};
  Level level{plan, {{0, 0, 0}, plan.resolution, 0.0f}};
  for (int i = 0; i < 12 * 12 * 12; ++i) {
    const Vec3i at{i / 144, i / 12 % 12, i % 12};
    level.sigma.set(at, density(at));
  }
  return level;
}

TEST(Sharpen, EvenRisingAndPeakingDensityStays) {
  const auto even = level_of([](Vec3i) { return 3.0f; });
  const auto rising = level_of([](Vec3i p) { return 0.5f * float(p.x); });
  const auto sheet = level_of([](Vec3i p) { return p.x == 6 ? 4.0f : 0.0f; });
  const auto edge = level_of([](Vec3i p) { return p.x < 6 ? 4.0f : 0.0f; });
  for (int x = 1; x < 11; ++x) {
    EXPECT_FLOAT_EQ(sharpened_density(even, {x, 6, 6}, 1), 3);
    EXPECT_FLOAT_EQ(sharpened_density(rising, {x, 6, 6}, 1), 0.5f * float(x));
    EXPECT_FLOAT_EQ(sharpened_density(sheet, {x, 6, 6}, 1), x == 6 ? 4 : 0);
    EXPECT_FLOAT_EQ(sharpened_density(edge, {x, 6, 6}, 1), x < 6 ? 4 : 0);
  }
}

TEST(Sharpen, WhatDenseNeighboursBringIsTakenOff) {
  // Half covered, before opaque matter: an eighth of what the neighbour has more comes in, an eighth of its own goes.
  const auto rim = level_of([](Vec3i p) { return p.x < 6 ? 4.0f : p.x == 6 ? 0.7f : 0.0f; });
  const double brought = 0.125 * (4.0 - 0.7) - 0.125 * 0.7;
  EXPECT_NEAR(sharpened_density(rim, {6, 6, 6}, 1), 0.7 - brought, 1e-6);
  EXPECT_NEAR(sharpened_density(rim, {6, 6, 6}, 0.5), 0.7 - 0.5 * brought, 1e-6);
  EXPECT_FLOAT_EQ(sharpened_density(rim, {6, 6, 6}, 0), 0.7f);
  EXPECT_FLOAT_EQ(sharpened_density(rim, {6, 6, 6}, 4), 0);
  EXPECT_FLOAT_EQ(sharpened_density(rim, {5, 6, 6}, 1), 4);
}

TEST(Sharpen, FinerGridsAndTheOutsideCountAsLikeTheVoxel) {
  auto level = level_of([](Vec3i p) { return p.x < 6 ? 0.0f : 1.0f; });
  level.plan.hole_min = {0, 0, 0};
  level.plan.hole_max = {6, 12, 12};
  EXPECT_FLOAT_EQ(sharpened_density(level, {6, 6, 6}, 1), 1) << "the hole's zeros are those of another grid";
  for (int y = 0; y < 12; ++y) {
    for (int z = 0; z < 12; ++z) level.sigma.set({5, y, z}, 9.0f);
  }
  EXPECT_FLOAT_EQ(sharpened_density(level, {6, 6, 6}, 1), 1);
  level.plan.hole_max = {};
  EXPECT_FLOAT_EQ(sharpened_density(level, {6, 6, 6}, 1), 0);
  level.plan.box.min.x = 6;
  EXPECT_FLOAT_EQ(sharpened_density(level, {6, 6, 6}, 1), 1);
}

/// Opaque, with a centre and a radius that no lattice knows: its picture is a disc, whose area tells how far it grew.
TEST(Sharpen, AnOpaqueBallKeepsItsSize) {
  constexpr double kRadius = 0.1734, kDistance = 50, kFocal = 9600;  // 0.0026 world units a pixel
  const AnalyticField ball({{0, 0, 0}, 0.5, 1}, sphere_density({0.513f, 0.491f, 0.507f}, float(0.5 * kRadius), 2000));
  const Vec3d centre = ball.frame().world_from_unit(Vec3d{0.513, 0.491, 0.507});
  const Camera camera = camera_at("far", centre + Vec3d{0.6, -0.7, 0.4} * kDistance, centre, 100, 100, kFocal);
  const auto grown_by = [&](double sharpening) {  // voxels
    Options options;
    options.voxel_size = 0.0127;
    options.sharpening = sharpening;
    const Volume volume = bake_volume(ball, {}, options);
    const VolumeImage image = integrate_volumes({&volume, 1}, camera.intrinsics, camera.world_from_camera);
    double area = 0;
    for (const float opacity : image.opacity) area += opacity;
    const double pixel = kDistance * length(Vec3d{0.6, -0.7, 0.4}) / kFocal;
    return (std::sqrt(area / std::numbers::pi) * pixel - kRadius) / options.voxel_size;
  };
  const double unsharpened = grown_by(0), sharpened = grown_by(1);
  std::printf("an opaque ball grows by %.3f voxels, sharpened by %.3f\n", unsharpened, sharpened);
  EXPECT_GT(unsharpened, 0.4);
  EXPECT_LT(std::abs(sharpened), 0.75 * unsharpened);
}

}  // namespace
}  // namespace cnerf::bake::test
