#include "export/web_bricks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "src/base/check.h"
#include "src/color/colorspace_math.h"
#include "tests/export/test_volumes.h"

namespace cnerf {
using namespace exporting;
namespace {

/// Number of the brick of a voxel given from the grid's beginning, and the voxel's place in it.
struct Place {
  std::size_t cell, number, local;
};
Place place_of(const WebBricks& bricks, Vec3i v) {
  const Vec3i n = bricks.counts;
  const std::size_t cell = (std::size_t(v.z / 8) * n.y + v.y / 8) * n.x + v.x / 8;
  std::size_t number = 0;
  for (std::size_t c = 0; c < cell; ++c) number += bricks.distance[c] == 0;
  return {cell, number, std::size_t((v.z % 8 * 8 + v.y % 8) * 8 + v.x % 8)};
}

TEST(WebBricks, TheGridBeginsOneVoxelBeforeTheFirst) {
  const bake::Volume volume = exporting::test::block_volume({10, 20, 30}, {14, 24, 34}, 5);
  const WebBricks bricks = make_web_bricks(volume);
  EXPECT_NEAR(bricks.origin.x, 1 + 9 * 0.05, 1e-12);
  EXPECT_NEAR(bricks.origin.z, 3 + 29 * 0.05, 1e-12);
  EXPECT_EQ(bricks.counts, (Vec3i{1, 1, 1}));
  EXPECT_EQ(bricks.voxels, 64u);
}

TEST(WebBricks, ValuesComeBackWithinTheirSteps) {
  bake::Volume volume = exporting::test::block_volume({0, 0, 0}, {9, 9, 9}, 5);
  for (bake::Voxel& voxel : volume.voxels) {
    voxel.sigma = 0.5f + float(voxel.i * voxel.j);  // optical depth 0.025 to 3.2
    voxel.rgb = {0.1f + 0.05f * float(voxel.i), 0.4f, 0.9f - 0.06f * float(voxel.k)};
    const Lab<float> lab = lab_from_linear_rgb(voxel.rgb);
    voxel.a = lab.a;
    voxel.b = lab.b;
  }
  const WebBricks bricks = make_web_bricks(volume);
  const std::size_t plane = bricks.stored() * kWebBrickVoxels;
  for (const bake::Voxel& voxel : volume.voxels) {
    const Place place = place_of(bricks, {voxel.i + 1, voxel.j + 1, voxel.k + 1});
    ASSERT_EQ(bricks.distance[place.cell], 0);
    const std::size_t at = place.number * kWebBrickVoxels + place.local;
    const double sigma = bricks.density_scale * std::pow(bricks.density[at] / 255.0, 3);
    const double code = 255 * std::cbrt(voxel.sigma / bricks.density_scale);
    EXPECT_NEAR(bricks.density[at], code, (sigma * volume.voxel_size > 6 ? 4.5 : 1.5) + 1e-4);
    EXPECT_NEAR(bricks.lab[at] / 2.55, lightness_from_luminance(luminance_of(voxel.rgb)), 1.5 / 2.55 + 1e-4);
    EXPECT_NEAR(bricks.lab[plane + at] - 128.0, voxel.a, 2.5 + 1e-4);
    EXPECT_NEAR(bricks.lab[2 * plane + at] - 128.0, voxel.b, 2.5 + 1e-4);
  }
}

/// A voxel at the corner of a brick reaches into its seven neighbours, and into no other.
TEST(WebBricks, WhatInterpolationReachesIsStored) {
  bake::Volume volume = exporting::test::block_volume({0, 0, 0}, {1, 1, 1}, 5);
  volume.voxels.push_back({7 + 31, 0, 0, 5, 0.4f, {1, 1, 1}, 0, 0});  // from the grid's beginning: 39 = 4 * 8 + 7
  const WebBricks bricks = make_web_bricks(volume);
  EXPECT_EQ(bricks.counts, (Vec3i{6, 1, 1}));
  EXPECT_EQ(bricks.distance, (std::vector<std::uint8_t>{0, 1, 2, 1, 0, 0}));
  EXPECT_EQ(bricks.stored(), 3u);
}

TEST(WebBricks, DistancesAreThoseToTheNearestStoredBrick) {
  bake::Volume volume = exporting::test::block_volume({0, 0, 0}, {1, 1, 1}, 5);
  volume.voxels.push_back({60, 40, 25, 5, 0.4f, {1, 1, 1}, 0, 0});
  const WebBricks bricks = make_web_bricks(volume);
  const Vec3i n = bricks.counts;
  for (int z = 0; z < n.z; ++z)
    for (int y = 0; y < n.y; ++y)
      for (int x = 0; x < n.x; ++x) {
        int nearest = 1000;
        for (int w = 0; w < n.z; ++w)
          for (int v = 0; v < n.y; ++v)
            for (int u = 0; u < n.x; ++u) {
              if (bricks.distance[(std::size_t(w) * n.y + v) * n.x + u] != 0) continue;
              nearest = std::min(nearest, std::max({std::abs(u - x), std::abs(v - y), std::abs(w - z)}));
            }
        EXPECT_EQ(bricks.distance[(std::size_t(z) * n.y + y) * n.x + x], nearest);
      }
}

TEST(WebBricks, ColourReachesBeyondDensity) {
  const bake::Volume volume = exporting::test::block_volume({0, 0, 0}, {4, 4, 4}, 5);
  const WebBricks bricks = make_web_bricks(volume);
  const Place inside = place_of(bricks, {2, 2, 2}), beyond = place_of(bricks, {5, 2, 2});
  EXPECT_EQ(bricks.density[beyond.local], 0);
  EXPECT_EQ(bricks.lab[beyond.local], bricks.lab[inside.local]);
}

/// What is nothing stays nothing and what is something stays something, or rays would find haze or holes.
TEST(WebBricks, SimplifyingMakesNeitherHazeNorHoles) {
  bake::Volume volume = exporting::test::block_volume({0, 0, 0}, {8, 8, 8}, 0.001f);
  volume.voxels.push_back({20, 0, 0, 400, 0.4f, {1, 1, 1}, 0, 0});
  const WebBricks bricks = make_web_bricks(volume);
  const Place beside = place_of(bricks, {9, 2, 2});
  EXPECT_EQ(bricks.density[beside.number * kWebBrickVoxels + beside.local], 0);
  const Place faint = place_of(bricks, {1, 1, 1});
  EXPECT_GT(bricks.density[faint.number * kWebBrickVoxels + faint.local], 0);
}

TEST(WebBricks, DifferencesUndoneGiveTheSame) {
  std::vector<std::uint8_t> bricks(3 * kWebBrickVoxels);
  for (std::size_t i = 0; i < bricks.size(); ++i) bricks[i] = std::uint8_t(i * i * 31 + i / 7);
  const std::vector<std::uint8_t> before = bricks;
  to_differences(bricks);
  EXPECT_NE(bricks, before);
  for (std::size_t begin = 0; begin < bricks.size(); begin += kWebBrickVoxels) {
    for (std::size_t i = 1; i < kWebBrickVoxels; ++i) {
      const std::size_t step = i % 8 ? 1 : i % 64 ? 8 : 64;
      bricks[begin + i] = std::uint8_t(bricks[begin + i] + bricks[begin + i - step]);
    }
  }
  EXPECT_EQ(bricks, before);
  std::vector<std::uint8_t> part(7);
  EXPECT_THROW(to_differences(part), ContractError);
}

TEST(WebBricks, AVolumeWithoutDensityIsRefused) {
  EXPECT_THROW((void)make_web_bricks(test::block_volume({0, 0, 0}, {2, 2, 2}, 0)), ContractError);
}

}  // namespace
}  // namespace cnerf
