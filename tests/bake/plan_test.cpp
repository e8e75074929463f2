#include "bake/lattice/plan.h"

#include <gtest/gtest.h>

#include "src/base/error.h"
#include "tests/bake/analytic_field.h"

namespace cnerf::bake::test {
namespace {

const SceneFrame kFrame{{10, 20, 30}, 0.25, 1};  // world box: 4 units around (10, 20, 30)

AnalyticField sphere_field() {
  return {kFrame, sphere_density({0.5f, 0.5f, 0.5f}, 0.25f, 100)};
}

TEST(Plan, ResolutionCountsTheLongestAxisMarginIncluded) {
  Options options;
  options.resolution = 68;
  options.aabb = "9,19.5,29.5,11,20.5,30.5";
  const Plan plan = plan_bake(sphere_field(), options);
  EXPECT_DOUBLE_EQ(plan.voxel_size, 2.0 / 64);
  EXPECT_EQ(plan.resolution, (Vec3i{68, 36, 36}));
  EXPECT_DOUBLE_EQ(plan.origin.x, 9 - 2 * plan.voxel_size);
}

TEST(Plan, VoxelSizeWinsOverResolution) {
  Options options;
  options.voxel_size = 0.1;
  options.aabb = " 9, 19.5, 29.5, 11, 20.5, 30.5 ";
  const Plan plan = plan_bake(sphere_field(), options);
  EXPECT_DOUBLE_EQ(plan.voxel_size, 0.1);
  EXPECT_EQ(plan.resolution, (Vec3i{24, 14, 14}));
}

TEST(Plan, BoxHugsWhatIsDense) {
  const Plan plan = plan_bake(sphere_field(), {});
  const double cell = 4.0 / 128;
  for (int axis = 0; axis < 3; ++axis) {
    const double centre = kFrame.world_centre[axis];
    EXPECT_LE(plan.box.min[axis], centre - 1);
    EXPECT_GE(plan.box.min[axis], centre - 1 - 2 * cell);
    EXPECT_GE(plan.box.max[axis], centre + 1);
    EXPECT_LE(plan.box.max[axis], centre + 1 + 2 * cell);
  }
}

TEST(Plan, BoxIsCutToTheFieldsDomain) {
  Options options;
  options.aabb = "-100,-100,-100,10,20,30";
  const Plan plan = plan_bake(sphere_field(), options);
  EXPECT_EQ(plan.box.min, (Vec3d{8, 18, 28}));
  EXPECT_EQ(plan.box.max, (Vec3d{10, 20, 30}));
}

TEST(Plan, RefusesBoxesThatMakeNoSense) {
  const AnalyticField field = sphere_field();
  for (const char* box :
       {"1,2,3", "9,19,29,11,21,x", "9,19,29,11,21,31,5", "11,19,29,9,21,31", "100,100,100,101,101,101"}) {
    Options options;
    options.aabb = box;
    EXPECT_THROW((void)plan_bake(field, options), UsageError) << box;
  }
  Options tiny;
  tiny.voxel_size = 1e-6;
  EXPECT_THROW((void)plan_bake(field, tiny), UsageError);
}

TEST(Plan, AnEmptyFieldIsAnInputError) {
  const AnalyticField empty(kFrame, [](Vec3f) { return 0.0f; });
  EXPECT_THROW((void)plan_bake(empty, {}), InputError);
}

}  // namespace
}  // namespace cnerf::bake::test
