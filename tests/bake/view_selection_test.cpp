#include "bake/view_selection.h"

#include <gtest/gtest.h>

#include "tests/bake/analytic_field.h"

namespace cnerf::test {
namespace {

/// A wall of `thickness` voxels, x in [32, 32 + thickness), in a lattice of 64^3.
BrickGrid<float> wall(int thickness, float sigma) {
  BrickGrid<float> grid({0, 0, 0}, {64, 64, 64}, 0.0f);
  for (int i = 32; i < 32 + thickness; ++i)
    for (int j = 0; j < 64; ++j)
      for (int k = 0; k < 64; ++k) grid.set({i, j, k}, sigma);
  return grid;
}

TEST(Transmittance, OfAWallIsItsOpticalDepth) {
  const BrickGrid<float> grid = wall(4, 1.5f);
  const float h = 0.25f;
  EXPECT_NEAR(transmittance_between(grid, h, {2.5f, 20.5f, 20.5f}, {62.5f, 20.5f, 20.5f}, 1e-6f),
              std::exp(-1.5f * 4 * h), 1e-5f);
  EXPECT_NEAR(transmittance_between(grid, h, {62.5f, 20.5f, 20.5f}, {2.5f, 20.5f, 20.5f}, 1e-6f),
              std::exp(-1.5f * 4 * h), 1e-5f);
  EXPECT_EQ(transmittance_between(grid, h, {2.5f, 20.5f, 20.5f}, {30.0f, 20.5f, 20.5f}, 1e-6f), 1.0f);
}

TEST(Transmittance, OfASurfaceVoxelLeavesTheVoxelOut) {
  const BrickGrid<float> grid = wall(4, 100.0f);
  EXPECT_EQ(transmittance_between(grid, 1, {32.5f, 20.5f, 20.5f}, {-500.5f, 20.5f, 20.5f}, 1e-3f), 1.0f);
  EXPECT_EQ(transmittance_between(grid, 1, {32.5f, 20.5f, 20.5f}, {500.5f, 20.5f, 20.5f}, 1e-3f), 0.0f);
}

TEST(Transmittance, SkippingEmptyBricksChangesNothing) {
  BrickGrid<float> sparse = wall(4, 0.3f);
  BrickGrid<float> full = wall(4, 0.3f);
  for (std::size_t b = 0; b < full.brick_count(); ++b) full.make_brick(b);
  for (int i = 0; i < 50; ++i) {
    const Vec3f from{1.3f, 3.0f + static_cast<float>(i), 40.2f};
    const Vec3f to{61.0f, 60.0f - static_cast<float>(i), 3.7f};
    EXPECT_NEAR(transmittance_between(sparse, 1, from, to, 1e-6f), transmittance_between(full, 1, from, to, 1e-6f),
                1e-6f);
  }
}

struct Ring {
  BakePlan plan;
  std::vector<BakeCamera> cameras;
};

/// Eight cameras around the middle of a lattice of 64^3 voxels of size 1.
Ring ring() {
  Ring r;
  r.plan.voxel_size = 1;
  r.plan.resolution = {64, 64, 64};
  const Vec3d middle{32, 32, 32};
  for (int c = 0; c < 8; ++c) {
    const double angle = c * 3.14159265358979 / 4;
    r.cameras.push_back(
        camera_at("ring", middle + Vec3d{std::cos(angle), std::sin(angle), 0} * 200.0, middle, 64, 64, 128));
  }
  return r;
}

TEST(ViewSelection, TriesOppositeCamerasEarly) {
  const Ring r = ring();
  const ViewSelection views(r.cameras, r.plan, {});
  const std::vector<int> order = views.try_order({32, 32, 32});
  ASSERT_EQ(order.size(), 8u);
  EXPECT_EQ((order[1] - order[0] + 8) % 8, 4);
  EXPECT_EQ((order[2] - order[0] + 8) % 4, 2) << "then at right angles";
}

TEST(ViewSelection, FindsTheCamerasOnTheRightSideOfAWall) {
  const Ring r = ring();
  BakeOptions options;
  options.views_per_voxel = 16;
  const ViewSelection views(r.cameras, r.plan, options);
  const Vec3d at{32.5, 32.5, 32.5};  // the wall's face towards -x: camera 4 and its neighbours
  const std::vector<SeenBy> seen = views.seen_by(wall(8, 50), at, views.try_order(at));
  ASSERT_EQ(seen.size(), 3u);
  for (const SeenBy& view : seen) EXPECT_TRUE(view.camera >= 3 && view.camera <= 5) << view.camera;
}

TEST(ViewSelection, KeepsToTheLimitAndToThePicture) {
  const Ring r = ring();
  BakeOptions options;
  options.views_per_voxel = 3;
  const ViewSelection views(r.cameras, r.plan, options);
  const BrickGrid<float> nothing({0, 0, 0}, {64, 64, 64}, 0.0f);
  EXPECT_EQ(views.seen_by(nothing, {32, 32, 32}, views.try_order({32, 32, 32})).size(), 3u);
  // Far above the ring: outside of every picture (field of view 28 degrees).
  EXPECT_TRUE(views.seen_by(nothing, {32, 32, 300}, views.try_order({32, 32, 300})).empty());
}

}  // namespace
}  // namespace cnerf::test
