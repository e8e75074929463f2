#include "bake/density/nested.h"

#include <gtest/gtest.h>

#include <cmath>

#include "bake/density/density_pass.h"
#include "bake/volume/dilate.h"
#include "bake/volume/integrate.h"
#include "bake/volume/resample.h"
#include "src/base/error.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/whole_bake.h"

namespace cnerf::bake::test {
namespace {

/// A near ball of radius 0.4 and a far wall, in a world of 16 units around (0, 8, 0), seen along +y.
AnalyticField near_and_far() {
  const SceneFrame frame{{0, 8, 0}, 1.0 / 16, 2};
  const auto ball = sphere_density({0.5f, 0.125f, 0.5f}, 0.025f, 2000);
  const auto wall = box_density({0.1f, 0.9f, 0.1f}, {0.9f, 0.94f, 0.9f}, 2000);
  AnalyticField field(frame, [=](Vec3f p) { return std::max(ball(p), wall(p)); });
  field.with_luminance([](Vec3f p, Vec3f) { return p.y < 0.5f ? 0.7f : 0.2f + 0.3f * p.x; });
  return field;
}

std::vector<Camera> forward_cameras() {
  return {camera_at("left", {-0.2, 0, 0}, {0, 4, 0}, 48, 48, 50),
          camera_at("right", {0.2, 0, 0}, {0, 4, 0}, 48, 48, 50)};
}

Options coarse() {
  Options options;
  options.resolution = 40;
  return options;
}

TEST(BakeLevels, OneGridUnlessAskedForOrTheFieldHasCascades) {
  const AnalyticField field = near_and_far();
  Options options = coarse();
  options.grids = "one";
  EXPECT_EQ(plan_levels(field, forward_cameras(), options).size(), 1u);
  options.grids = "auto";
  EXPECT_GT(plan_levels(field, forward_cameras(), options).size(), 1u);
  EXPECT_EQ(plan_levels(field, {}, options).size(), 1u) << "nothing says where the pixels look";
  const AnalyticField bounded({{0, 0, 0}, 0.5, 1}, sphere_density({0.5f, 0.5f, 0.5f}, 0.25f, 100));
  EXPECT_EQ(plan_levels(bounded, forward_cameras(), options).size(), 1u);
}

TEST(BakeLevels, FinerGridsHalveTheVoxelsAndFillTheHolesExactly) {
  const std::vector<Plan> plans = plan_levels(near_and_far(), forward_cameras(), coarse());
  ASSERT_GT(plans.size(), 1u);
  for (std::size_t finer = 0; finer + 1 < plans.size(); ++finer) {
    const Plan &inner = plans[finer], &outer = plans[finer + 1];
    EXPECT_DOUBLE_EQ(inner.voxel_size, outer.voxel_size / 2);
    const Vec3d margin = Vec3d{2, 2, 2} * inner.voxel_size;
    EXPECT_NEAR(length(inner.origin + margin - outer.world_from_voxel(outer.hole_min.cast<double>())), 0, 1e-9);
    const Vec3d end = inner.world_from_voxel(inner.resolution.cast<double>()) - margin;
    EXPECT_NEAR(length(end - outer.world_from_voxel(outer.hole_max.cast<double>())), 0, 1e-9);
    for (int axis = 0; axis < 3; ++axis) EXPECT_LE(inner.resolution[axis], 40 + 2);
  }
  EXPECT_EQ(plans[0].hole_min, plans[0].hole_max);
}

std::vector<Level> nested_levels(const ColorField& field, const std::vector<Camera>& cameras) {
  Journal journal;
  return bake_levels(field, plan_levels(field, cameras, coarse()), coarse(), journal);
}

std::vector<Volume> nested_volumes(const ColorField& field, const std::vector<Camera>& cameras) {
  Journal journal;
  const auto levels = bake_levels(field, plan_levels(field, cameras, coarse()), coarse(), journal);
  std::vector<Volume> volumes;
  for (const VolumePlanes& planes : bake_volumes(field, cameras, levels, coarse(), journal)) {
    volumes.push_back(whole_volume(dilated(planes, coarse().dilation)));
  }
  return volumes;
}

TEST(BakeLevels, NoPlaceIsBakedTwice) {
  const AnalyticField field = near_and_far();
  const auto levels = nested_levels(field, forward_cameras());
  ASSERT_GT(levels.size(), 1u);
  for (std::size_t outer = 1; outer < levels.size(); ++outer) {
    const Plan& plan = levels[outer].plan;
    const BrickGrid<float>& sigma = levels[outer].sigma;
    for (int i = plan.hole_min.x; i < plan.hole_max.x; ++i)
      for (int j = plan.hole_min.y; j < plan.hole_max.y; ++j)
        for (int k = plan.hole_min.z; k < plan.hole_max.z; ++k) ASSERT_EQ(sigma.at({i, j, k}), 0);
  }
}

double squared_error(const VolumeImage& a, const VolumeImage& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) sum += std::pow(double(a.rgb[i]) - b.rgb[i], 2);
  return sum / double(a.rgb.size());
}

TEST(BakeLevels, NestedGridsShowWhatOneFineGridShows) {
  const AnalyticField field = near_and_far();
  const std::vector<Camera> cameras = forward_cameras();
  const std::vector<Volume> nested = nested_volumes(field, cameras);
  ASSERT_GT(nested.size(), 1u);
  Options fine = coarse();
  fine.resolution = 120;
  const Volume one_fine = bake_volume(field, cameras, fine), one_coarse = bake_volume(field, cameras, coarse());
  const Camera& eye = cameras[0];
  const auto look = [&](std::span<const Volume> volumes) {
    return integrate_volumes(volumes, eye.intrinsics, eye.world_from_camera, {0.5, 1});
  };
  const VolumeImage truth = look({&one_fine, 1});
  const double of_nested = squared_error(look(nested), truth), of_coarse = squared_error(look({&one_coarse, 1}), truth);
  EXPECT_LT(of_nested, 0.75 * of_coarse);
}

TEST(BakeLevels, OneLatticeHoldsTheDensityOfAllLevels) {
  const AnalyticField field = near_and_far();
  const Level merged = merged_level(nested_levels(field, forward_cameras()), coarse());
  const BrickGrid<float> direct = bake_density(field, plan_bake(field, coarse()), coarse(), [](double) {});
  ASSERT_EQ(merged.sigma.size(), direct.size());
  EXPECT_EQ(merged.plan.hole_min, merged.plan.hole_max);
  double difference = 0, sum = 0;
  for (int i = 0; i < direct.size().x; ++i) {
    for (int j = 0; j < direct.size().y; ++j) {
      for (int k = 0; k < direct.size().z; ++k) {
        difference += std::abs(merged.sigma.at({i, j, k}) - direct.at({i, j, k}));
        sum += direct.at({i, j, k});
      }
    }
  }
  EXPECT_GT(sum, 0);
  EXPECT_LT(difference, 0.05 * sum);  // finer sub-samples see rims that coarse ones miss
}

TEST(BakeLevels, MergingKeepsTheMatter) {
  const AnalyticField field = near_and_far();
  const std::vector<Volume> nested = nested_volumes(field, forward_cameras());
  const auto matter = [](const Volume& volume) {
    double sum = 0;
    for (const Voxel& v : volume.voxels) sum += v.sigma * std::pow(volume.voxel_size, 3);
    return sum;
  };
  double expected = 0;
  for (const Volume& volume : nested) expected += matter(volume);
  const Volume merged = merged_volume(nested);
  EXPECT_NEAR(matter(merged), expected, 1e-4 * expected);
  EXPECT_DOUBLE_EQ(merged.voxel_size, nested.back().voxel_size);
}

/// A voxel size that went through a file is half of the other only nearly.
TEST(BakeLevels, MergingMakesNoPlaceTwice) {
  Volume coarse, fine;
  coarse.voxel_size = 0.1;
  coarse.resolution = fine.resolution = {64, 1, 1};
  fine.voxel_size = 0.05 * (1 - 1e-14);
  for (int i = 0; i < 64; ++i) {
    (i < 32 ? fine : coarse).voxels.push_back({i, 0, 0, 1, 0.5f, {0.5f, 0.5f, 0.5f}, 0, 0});
  }
  for (int i = 32; i < 64; ++i) fine.voxels.push_back({i, 0, 0, 1, 0.5f, {0.5f, 0.5f, 0.5f}, 0, 0});
  fine.origin = {1e-15, 0, 0};
  EXPECT_EQ(merged_volume({fine, coarse}).voxels.size(), 64u);
  for (Voxel& voxel : fine.voxels) voxel.i += 64;  // before and beyond what the coarse one has
  for (Voxel& voxel : coarse.voxels) voxel.i -= 32;
  EXPECT_EQ(merged_volume({fine, coarse}).voxels.size(), 64u);
}

TEST(BakeLevels, ABudgetMakesVoxelsLargerUntilTheyFit) {
  const AnalyticField field({{0, 0, 0}, 0.5, 1}, sphere_density({0.5f, 0.5f, 0.5f}, 0.25f, 100));
  Options options;
  options.resolution = 256;
  const std::size_t without = cycles_bytes(plan_within_budget(field, {}, options));
  EXPECT_NEAR(double(without), 256.0 * 256 * 256 * 20, 0.05 * double(without));
  options.budget = "64M";
  const std::size_t within = cycles_bytes(plan_within_budget(field, {}, options));
  EXPECT_LE(within, std::size_t{64} << 20);
  EXPECT_GT(within, std::size_t{50} << 20) << "and no larger than they must";
  options.budget = "4G";
  EXPECT_EQ(cycles_bytes(plan_within_budget(field, {}, options)), without);
  for (const char* bad : {"much", "-1G", "4T", "4GB", "0", "2k"}) {
    options.budget = bad;
    EXPECT_THROW((void)plan_within_budget(field, {}, options), UsageError) << bad;
  }
}

}  // namespace
}  // namespace cnerf::bake::test
