#include "bake/volume/dilate.h"

#include <gtest/gtest.h>

#include <map>
#include <tuple>

#include <algorithm>
#include <cstdlib>

#include "src/base/error.h"

namespace cnerf::bake {
namespace {

Volume two_voxels() {
  Volume volume;
  volume.voxel_size = 1;
  volume.resolution = {16, 16, 16};
  volume.voxels.push_back({7, 7, 7, 3.0f, 0.2f, {1, 0, 0}, 10, 20});
  volume.voxels.push_back({10, 7, 7, 4.0f, 0.4f, {0, 1, 0}, 30, 40});
  return volume;
}

const Voxel* find(const Volume& volume, int i, int j, int k) {
  for (const Voxel& v : volume.voxels) {
    if (v.i == i && v.j == j && v.k == k) return &v;
  }
  return nullptr;
}

TEST(Dilate, ReachesTwoVoxelsInEveryDirectionAndNoFurther) {
  Volume volume = two_voxels();
  dilate_colors(volume, 2);
  // Two cubes of 5^3 that overlap in 2 x 5 x 5.
  EXPECT_EQ(volume.voxels.size(), 125u + 125u - 50u);
  ASSERT_NE(find(volume, 5, 5, 5), nullptr);
  EXPECT_EQ(find(volume, 4, 7, 7), nullptr);
  EXPECT_TRUE(std::is_sorted(volume.voxels.begin(), volume.voxels.end(), [](const auto& a, const auto& b) {
    return std::tie(a.i, a.j, a.k) < std::tie(b.i, b.j, b.k);
  }));
}

TEST(Dilate, NewVoxelsHaveTheNearestColorAndNoDensity) {
  Volume volume = two_voxels();
  dilate_colors(volume, 2);
  for (const Voxel& v : volume.voxels) {
    const bool original = v.j == 7 && v.k == 7 && (v.i == 7 || v.i == 10);
    EXPECT_EQ(v.sigma > 0, original);
    const int i = std::abs(v.i - 7) < std::abs(v.i - 10) ? v.i - 7 : v.i - 10;
    if (i * i + (v.j - 7) * (v.j - 7) + (v.k - 7) * (v.k - 7) >= 4) {  // out of interpolation's reach: any of the two
      EXPECT_TRUE(v.rgb == (Vec3f{1, 0, 0}) || v.rgb == (Vec3f{0, 1, 0}));
      continue;
    }
    EXPECT_EQ(v.rgb, (std::abs(v.i - 7) < std::abs(v.i - 10) ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0}));
  }
  EXPECT_EQ(find(volume, 8, 8, 8)->a, 10);
  EXPECT_EQ(find(volume, 9, 8, 8)->luminance, 0.4f);
}

TEST(Dilate, BeyondInterpolationABrickHasOneColor) {
  Volume volume = two_voxels();
  dilate_colors(volume, 2);
  std::map<std::tuple<int, int, int>, Vec3f> of_brick;
  std::size_t outer = 0;
  for (const Voxel& v : volume.voxels) {
    const int i = std::abs(v.i - 7) < std::abs(v.i - 10) ? v.i - 7 : v.i - 10;
    if (i * i + (v.j - 7) * (v.j - 7) + (v.k - 7) * (v.k - 7) < 4) continue;
    ++outer;
    const auto [brick, is_first] = of_brick.try_emplace({v.i / 8, v.j / 8, v.k / 8}, v.rgb);
    EXPECT_EQ(brick->second, v.rgb);
  }
  EXPECT_GT(outer, 4 * of_brick.size());
}

TEST(Dilate, TwiceIsOnceAndGrowingLaterIsTheSame) {
  Volume once = two_voxels();
  dilate_colors(once, 3);
  Volume steps = two_voxels();
  dilate_colors(steps, 2);
  dilate_colors(steps, 2);
  EXPECT_EQ(steps.voxels.size(), 200u);
  dilate_colors(steps, 3);
  ASSERT_EQ(steps.voxels.size(), once.voxels.size());
  for (std::size_t v = 0; v < once.voxels.size(); ++v) EXPECT_EQ(steps.voxels[v].rgb, once.voxels[v].rgb);
}

TEST(Dilate, RefusesDuplicates) {
  Volume volume = two_voxels();
  volume.voxels.push_back(volume.voxels.front());
  EXPECT_THROW(dilate_colors(volume, 2), ContractError);
}

}  // namespace
}  // namespace cnerf::bake
