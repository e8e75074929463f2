#include "bake/volume/integrate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "bake/volume/dilate.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/whole_bake.h"

namespace cnerf::bake::test {
namespace {

constexpr double kVoxel = 0.05;
const Vec3f kColor{0.2f, 0.5f, 0.8f};

/// Voxels [min, max) of constant density and colour, dilated; voxel (0, 0, 0) has its corner at (1, 2, 3).
Volume block(Vec3i min, Vec3i max, float sigma) {
  Volume volume;
  volume.origin = {1, 2, 3};
  volume.voxel_size = kVoxel;
  volume.resolution = max + Vec3i{2, 2, 2};
  for (int i = min.x; i < max.x; ++i)
    for (int j = min.y; j < max.y; ++j)
      for (int k = min.z; k < max.z; ++k) volume.voxels.push_back({i, j, k, sigma, 0.5f, kColor, 0, 0});
  dilate_colors(volume, 2);
  return volume;
}

Vec3d world_of(const Volume& volume, Vec3d voxels) {
  return volume.origin + voxels * volume.voxel_size;
}

/// Looks down on the volume along -z from far away, so that rays are nearly parallel; one voxel = `zoom` pixels.
Camera from_above(const Volume& volume, Vec3d target_voxel, int size, double zoom) {
  const Vec3d target = world_of(volume, target_voxel);
  const double distance = 1000;
  return camera_at("above", target + Vec3d{0, 0, distance}, target, size, size, zoom / kVoxel * distance);
}

TEST(Integrator, SlabIsExactlyBeerAndLambert) {
  const float sigma = 2;
  const Volume volume = block({10, 10, 10}, {30, 30, 20}, sigma);
  const Camera camera = from_above(volume, {20, 20, 15}, 9, 1);
  const VolumeImage image = integrate_volumes({&volume, 1}, camera.intrinsics, camera.world_from_camera);
  const double opacity = 1 - std::exp(-sigma * 10 * kVoxel);
  const std::size_t middle = 4 * 9 + 4;
  EXPECT_NEAR(image.opacity[middle], opacity, 1e-4);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(image.rgb[3 * middle + c], kColor[c] * opacity, 1e-4);
}

TEST(Integrator, ColorIsPureUpToTheRim) {
  const Volume volume = block({10, 10, 10}, {20, 20, 20}, 100);
  const Camera camera = from_above(volume, {15, 15, 15}, 48, 4);
  const VolumeImage image = integrate_volumes({&volume, 1}, camera.intrinsics, camera.world_from_camera);
  std::size_t rim = 0;
  for (std::size_t p = 0; p < image.opacity.size(); ++p) {
    if (image.opacity[p] < 1e-3) continue;
    rim += image.opacity[p] < 0.9 ? 1 : 0;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(image.rgb[3 * p + c] / image.opacity[p], kColor[c], 1e-5);
  }
  EXPECT_GE(rim, 16u);
}

TEST(Integrator, HalfOpticalDepthLiesOnTheFaceOfTheBlock) {
  // Trilinear interpolation of cell-centred values passes half the density exactly at the block's face.
  const Volume volume = block({10, 10, 10}, {20, 20, 20}, 4);
  const double zoom = 16;
  const Camera camera = from_above(volume, {10, 15, 15}, 32, zoom);  // x = voxel 10's corner in the middle
  const VolumeImage image = integrate_volumes({&volume, 1}, camera.intrinsics, camera.world_from_camera, {0.25, 8});
  const auto depth = [&](int x) { return -std::log(1 - image.opacity[16 * 32 + x]); };
  EXPECT_NEAR(depth(0), 0, 1e-6) << "one voxel outside";
  EXPECT_NEAR(depth(31), 4 * 10 * kVoxel, 0.01) << "one voxel inside";
  EXPECT_NEAR((depth(15) + depth(16)) / 2, 4 * 10 * kVoxel / 2, 2e-3);
}

TEST(Integrator, SkippingEmptySpaceChangesNothing) {
  // Two blocks with empty bricks between them; the same with a voxel of negligible density in every brick.
  Volume apart = block({0, 0, 0}, {6, 6, 6}, 3);
  const Volume far = block({60, 60, 60}, {66, 66, 66}, 3);
  apart.voxels.insert(apart.voxels.end(), far.voxels.begin(), far.voxels.end());
  Volume filled = apart;
  for (int i = 10; i < 56; i += 4)
    for (int j = 10; j < 56; j += 4)
      for (int k = 10; k < 56; k += 4) filled.voxels.push_back({i, j, k, 1e-12f, 0, {}, 0, 0});
  const Camera camera =
      camera_at("diagonal", world_of(apart, {-60, -55, -52}), world_of(apart, {33, 33, 33}), 24, 24, 60);
  const VolumeImage a = integrate_volumes({&apart, 1}, camera.intrinsics, camera.world_from_camera);
  const VolumeImage b = integrate_volumes({&filled, 1}, camera.intrinsics, camera.world_from_camera);
  float largest = 0;
  for (std::size_t p = 0; p < a.opacity.size(); ++p) {
    EXPECT_NEAR(a.opacity[p], b.opacity[p], 1e-5);
    largest = std::max(largest, a.opacity[p]);
  }
  EXPECT_GT(largest, 0.5f) << "the camera sees the blocks";
}

TEST(Integrator, NestedGridsMayBeFollowedInStepsOfTheVoxelsThatAreNear) {
  // A sheet of two fine voxels, which steps of coarse ones would miss or count twice, in front of a coarse block.
  Volume coarse = block({0, 0, 0}, {20, 20, 20}, 0.8), fine = block({0, 0, 0}, {2, 64, 64}, 60);
  constexpr double kRatio = 8;
  fine.voxel_size = coarse.voxel_size / kRatio;
  fine.origin = world_of(coarse, {21, 5, 5});
  const std::vector<Volume> both = {coarse, fine};
  for (const Vec3d eye : {Vec3d{60, 12, 11}, Vec3d{24, 10, 10}}) {
    const Camera camera = camera_at("eye", world_of(coarse, eye), world_of(coarse, {0, 9, 9.5}), 16, 16, 20);
    const VolumeImage near = integrate_volumes(both, camera.intrinsics, camera.world_from_camera, {0.25, 1});
    const VolumeImage all = integrate_volumes(both, camera.intrinsics, camera.world_from_camera, {0.25 / kRatio, 1});
    float largest = 0;
    for (std::size_t p = 0; p < near.opacity.size(); ++p) {
      EXPECT_NEAR(near.opacity[p], all.opacity[p], 2e-3);
      largest = std::max(largest, near.opacity[p]);
    }
    EXPECT_GT(largest, 0.5f) << "the camera sees the blocks";
  }
}

TEST(Integrator, ABakedSphereShowsTheFieldsOpticalDepth) {
  const SceneFrame frame{{0, 0, 0}, 0.25, 1};                                      // radius 0.25 unit = 1 world unit
  const AnalyticField field(frame, sphere_density({0.5f, 0.5f, 0.5f}, 0.25f, 4));  // sigma 1 per world unit
  Options options;
  options.resolution = 68;
  const Volume volume = bake_volume(field, {}, options);
  const Camera camera = camera_at("side", {0, -1000, 0}, {0, 0, 0}, 21, 21, 8000);  // 0.125 world units a pixel
  const VolumeImage image = integrate_volumes({&volume, 1}, camera.intrinsics, camera.world_from_camera, {0.25, 1});
  for (int x = 0; x < 21; ++x) {
    const double offset = (x - 10) * 0.125;
    if (std::abs(offset) == 1) continue;  // the rim, where a voxel's blur is as large as the chord
    const double chord = offset * offset < 1 ? 2 * std::sqrt(1 - offset * offset) : 0;
    EXPECT_NEAR(image.opacity[10 * 21 + x], 1 - std::exp(-chord), 0.03) << offset;
  }
}

}  // namespace
}  // namespace cnerf::bake::test
