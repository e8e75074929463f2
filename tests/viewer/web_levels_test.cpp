#include "export/web_levels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "src/base/check.h"
#include "tests/export/test_volumes.h"

namespace cnerf {
using namespace exporting;
namespace {

constexpr double kCoarse = 0.1, kFine = 0.05;
constexpr float kSigmaCoarse = 5, kSigmaFine = 9;

/// A fine block of 16^3 voxels, and a coarse one that goes on along x where it ends.
std::vector<bake::Volume> lit_grids() {
  bake::Volume coarse = exporting::test::block_volume({0, 0, 0}, {16, 8, 8}, kSigmaCoarse, kCoarse);
  std::erase_if(coarse.voxels, [](const bake::Voxel& voxel) { return voxel.i < 8; });
  return {exporting::test::block_volume({0, 0, 0}, {16, 16, 16}, kSigmaFine, kFine, {0.7f, 0.3f, 0.1f}), coarse};
}
/// A point given in coarse voxels.
Vec3d coarse_point(double x, double y, double z) {
  return Vec3d{1, 2, 3} + Vec3d{x, y, z} * kCoarse;
}

/// Density of the voxel around a point; none where no brick is stored.
std::optional<double> sigma_at(const WebBricks& bricks, Vec3d world) {
  const Vec3d p = (world - bricks.origin) / bricks.voxel_size;
  const Vec3i v{int(std::floor(p.x)), int(std::floor(p.y)), int(std::floor(p.z))};
  const Vec3i n = bricks.counts;
  if (v.x < 0 || v.y < 0 || v.z < 0 || v.x >= 8 * n.x || v.y >= 8 * n.y || v.z >= 8 * n.z) return std::nullopt;
  const std::size_t cell = (std::size_t(v.z / 8) * n.y + v.y / 8) * n.x + v.x / 8;
  if (bricks.distance[cell] != 0) return std::nullopt;
  std::size_t number = 0;
  for (std::size_t c = 0; c < cell; ++c) number += bricks.distance[c] == 0;
  const std::uint8_t code =
      bricks.density[number * kWebBrickVoxels + std::size_t((v.z % 8 * 8 + v.y % 8) * 8 + v.x % 8)];
  return bricks.density_scale * std::pow(code / 255.0, 3);
}
/// Relative error of a density that is a code and a half off.
double tolerance(const WebBricks& bricks, double sigma) {
  return sigma * 3 * 1.6 / (255 * std::cbrt(sigma / bricks.density_scale));
}

TEST(WebLevels, ACoarserLevelHoldsWhatFinerOnesHold) {
  const auto levels = make_web_levels(lit_grids(), 256);
  ASSERT_EQ(levels.size(), 2u);
  const WebBricks& coarse = levels[0];
  EXPECT_NEAR(coarse.voxel_size, kCoarse, 1e-12);
  EXPECT_EQ(coarse.voxels, 16u * 8 * 8);
  EXPECT_NEAR(*sigma_at(coarse, coarse_point(3.5, 3.5, 3.5)), kSigmaFine, tolerance(coarse, kSigmaFine));
  EXPECT_NEAR(*sigma_at(coarse, coarse_point(12.5, 3.5, 3.5)), kSigmaCoarse, tolerance(coarse, kSigmaCoarse));
}

TEST(WebLevels, AFinerLevelAnswersForItsPlaceAndTheEmptyVoxelsAroundIt) {
  const Aabbd cover = make_web_levels(lit_grids(), 256)[1].cover;
  const Vec3d low = coarse_point(-1, -1, -1), high = coarse_point(8, 9, 9);  // matter goes on at x = 8 only
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(cover.min[axis], low[axis], 1e-9);
    EXPECT_NEAR(cover.max[axis], high[axis], 1e-9);
  }
}

/// Trilinear interpolation between the coarse voxels at x = 7.5, with the mean of the finer ones, and at 8.5.
TEST(WebLevels, BeyondItsBorderAFinerLevelGoesOnAsTheCoarserDoes) {
  const auto levels = make_web_levels(lit_grids(), 256);
  const WebBricks& fine = levels[1];
  const double expected = 0.25 * kSigmaFine + 0.75 * kSigmaCoarse;
  EXPECT_NEAR(*sigma_at(fine, coarse_point(8.25, 3.5, 3.5)), expected, tolerance(fine, expected));
  EXPECT_NEAR(*sigma_at(fine, coarse_point(7.75, 3.5, 3.5)), kSigmaFine, tolerance(fine, kSigmaFine));
  EXPECT_EQ(sigma_at(fine, coarse_point(8.25, 8.25, 3.5)).value_or(0) > 0, true) << "half-way out at a side";
  EXPECT_EQ(sigma_at(fine, coarse_point(-0.25, 3.5, 3.5)).value_or(0), 0) << "nothing is there";
  EXPECT_FALSE(sigma_at(fine, coarse_point(11, 3.5, 3.5))) << "one layer, no more";
}

TEST(WebLevels, WhereACoarserLevelHasNoBrickFinerOnesHaveNothing) {
  std::vector<bake::Volume> grids = lit_grids();
  std::erase_if(grids[0].voxels, [](const bake::Voxel& v) { return v.i % 16 > 2 || v.j > 1; });
  grids[0].voxels.push_back({39, 39, 39, 4, 0.4f, {1, 1, 1}, 0, 0});
  const auto levels = make_web_levels(grids, 256);
  for (const bake::Voxel& voxel : grids[0].voxels) {
    const Vec3d centre = grids[0].origin + Vec3d{voxel.i + 0.5, voxel.j + 0.5, voxel.k + 0.5} * kFine;
    EXPECT_GT(sigma_at(levels[1], centre).value_or(0), 0);
    EXPECT_GT(sigma_at(levels[0], centre).value_or(0), 0);
  }
}

TEST(WebLevels, LargerVoxelsAreFullUpToTheBorder) {
  const auto levels = make_web_levels(lit_grids(), 12);  // of 20 each: 5/3 as large, so that no face is on a face
  const WebBricks& fine = levels[1];
  EXPECT_NEAR(fine.voxel_size, kFine * 20 / 12, 1e-9);
  EXPECT_NEAR(fine.cover.max.x, coarse_point(8, 0, 0).x, 1e-9) << "the border stays where it is";
  const double inside = *sigma_at(fine, coarse_point(4, 4, 4));
  EXPECT_NEAR(inside, kSigmaFine, tolerance(fine, kSigmaFine));
  for (double beyond = 0; beyond < 1; beyond += 0.2) {  // coarse voxels: what interpolation finds at the border
    const double sigma = sigma_at(fine, coarse_point(8 - 0.8 + beyond, 4, 4)).value_or(0);
    EXPECT_GT(sigma, 0.95 * kSigmaCoarse) << "no dark layer";
    EXPECT_LT(sigma, 1.05 * kSigmaFine) << "no double one";
  }
}

TEST(WebLevels, OneGridIsOneLevelThatCoversItself) {
  const auto levels = make_web_levels({lit_grids()[0]}, 256);
  ASSERT_EQ(levels.size(), 1u);
  EXPECT_EQ(levels[0].cover.min, levels[0].origin);
  EXPECT_NEAR(levels[0].cover.max.x, levels[0].origin.x + levels[0].counts.x * 8 * kFine, 1e-9);
}

TEST(WebLevels, GridsWithoutDensityAreLeftOut) {
  std::vector<bake::Volume> grids = lit_grids();
  for (bake::Voxel& voxel : grids[0].voxels) voxel.sigma = 0;
  EXPECT_EQ(make_web_levels(grids, 256).size(), 1u);
  for (bake::Voxel& voxel : grids[1].voxels) voxel.sigma = 0;
  EXPECT_THROW((void)make_web_levels(grids, 256), ContractError);
}

}  // namespace
}  // namespace cnerf
