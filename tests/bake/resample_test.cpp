#include "bake/volume/resample.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/check.h"

namespace cnerf::bake {
namespace {

Volume cube(int side, float sigma, Vec3f rgb) {
  Volume volume;
  volume.origin = {1, 2, 3};
  volume.voxel_size = 0.1;
  volume.resolution = {side, side, side};
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < side; ++k) volume.voxels.push_back({i, j, k, sigma, 0.3f, rgb, 0, 0});
  return volume;
}

double total_optical(const Volume& volume) {
  double total = 0;
  for (const Voxel& voxel : volume.voxels) total += voxel.sigma * std::pow(volume.voxel_size, 3);
  return total;
}

TEST(Resample, LeavesWhatIsSmallEnoughAsItIs) {
  const Volume volume = cube(8, 2, {0.2f, 0.5f, 0.8f});
  EXPECT_EQ(resample_volume(volume, 8).voxels, volume.voxels);
  EXPECT_EQ(resample_volume(volume, 64).voxel_size, volume.voxel_size);
}

TEST(Resample, KeepsDensityColourAndPlaceAtAnyRatio) {
  const Volume volume = cube(12, 2, {0.2f, 0.5f, 0.8f});
  for (const int resolution : {4, 5, 7, 11}) {
    const Volume small = resample_volume(volume, resolution);
    EXPECT_EQ(small.resolution, (Vec3i{resolution, resolution, resolution}));
    EXPECT_EQ(small.voxels.size(), std::size_t(std::pow(resolution, 3)));
    EXPECT_NEAR(small.voxel_size * resolution, 1.2, 1e-12);
    EXPECT_EQ(small.origin, volume.origin);
    for (const Voxel& voxel : small.voxels) {
      EXPECT_NEAR(voxel.sigma, 2, 1e-5);
      EXPECT_NEAR(voxel.rgb.z, 0.8, 1e-5);
      EXPECT_NEAR(voxel.luminance, 0.3, 1e-5);
    }
    EXPECT_NEAR(total_optical(small), total_optical(volume), 1e-5);
  }
}

/// One voxel in four of a 2 x 2 x 1 block: a quarter of the density, all of the colour.
TEST(Resample, ThinMatterGetsThinnerNotDarker) {
  Volume volume = cube(4, 0, {0, 0, 0});
  volume.voxels = {{0, 0, 0, 8, 0.4f, {1, 0, 0}, 0, 0}, {1, 0, 0, 0, 0.9f, {0, 1, 0}, 0, 0}};
  const Volume small = resample_volume(volume, 2);
  ASSERT_EQ(small.voxels.size(), 1u);
  EXPECT_NEAR(small.voxels[0].sigma, 1, 1e-6);  // 8 / 2^3
  EXPECT_NEAR(small.voxels[0].rgb.x, 1, 1e-6);
  EXPECT_NEAR(small.voxels[0].luminance, 0.4, 1e-6);
}

TEST(Resample, IndicesBelowZeroStayWhereTheyAre) {
  Volume volume = cube(4, 0, {0, 0, 0});
  volume.voxels = {{-2, -1, 3, 5, 0.4f, {1, 1, 1}, 0, 0}};
  const Volume small = resample_volume(volume, 2);
  ASSERT_EQ(small.voxels.size(), 1u);
  EXPECT_EQ(small.voxels[0].i, -1);
  EXPECT_EQ(small.voxels[0].j, -1);
  EXPECT_EQ(small.voxels[0].k, 1);
}

TEST(Resample, AnEmptyVolumeIsRefused) {
  EXPECT_THROW((void)resample_volume(Volume{}, 8), ContractError);
}

}  // namespace
}  // namespace cnerf::bake
