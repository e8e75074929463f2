/// The view-averaged field: what a bake is made from.

#include "bake/color/view_average.h"
#include "bake/density/nested.h"

#include <gtest/gtest.h>

#include "src/base/parallel.h"
#include "tests/bake/analytic_field.h"
#include "tests/bake/processor_alone.h"
#include "tests/bake/whole_bake.h"

namespace cnerf::bake::test {
namespace {

std::unique_ptr<ViewAverage> view_average(const ColorField& field, const std::vector<Camera>& cameras,
                                          const Options& options) {
  Observer nobody;
  return make_view_average(field, cameras, options, ProcessorAlone(), nobody);
}

const SceneFrame kCentredFrame{{0, 0, 0}, 0.25, 1};  // world box: 4 units around the origin
constexpr Vec3f kMiddle{0.5f, 0.5f, 0.5f};

/// An opaque ball of world radius 1 that shines 0.2 towards +x, 0.6 towards +y and 0.4 elsewhere.
AnalyticField shining_ball() {
  AnalyticField field(kCentredFrame, sphere_density(kMiddle, 0.25f, 400));
  field.with_luminance([](Vec3f, Vec3f d) { return d.x < -0.9f ? 0.2f : d.y < -0.9f ? 0.6f : 0.4f; });
  return field;
}

std::vector<Camera> two_cameras() {
  return {camera_at("x", {8, 0, 0}, {0, 0, 0}, 64, 64, 100), camera_at("y", {0, 8, 0}, {0, 0, 0}, 64, 64, 100)};
}

Options few_voxels() {
  Options options;
  options.resolution = 48;
  return options;
}

std::vector<float> averages(const ViewAverage& average, const std::vector<Vec3f>& unit) {
  std::vector<float> luminance(unit.size());
  average.query(unit, luminance);
  return luminance;
}

TEST(ViewAverage, IsTheMeanOfTheViewsThatSeeAPoint) {
  const AnalyticField field = shining_ball();
  const auto average = view_average(field, two_cameras(), few_voxels());
  const auto on_ball = [](Vec3f direction) { return kMiddle + normalized(direction) * 0.25f; };
  const auto luminance =
      averages(*average, {on_ball({1, 0, 0}), on_ball({0, 1, 0}), on_ball({1, 1, 0}), on_ball({-1, -1, 0})});
  EXPECT_FLOAT_EQ(luminance[0], 0.2f);
  EXPECT_FLOAT_EQ(luminance[1], 0.6f);
  EXPECT_NEAR(luminance[2], 0.4, 0.02) << "both see it alike";
  EXPECT_NEAR(luminance[3], (0.2 + 0.6 + 4 * 0.4) / 6, 1e-6) << "none sees it: from all sides";
}

TEST(ViewAverage, IsWhatABakePutsIntoItsVoxels) {
  const AnalyticField field = shining_ball();
  const Volume volume = bake_volume(field, two_cameras(), few_voxels());
  const auto average = view_average(field, two_cameras(), few_voxels());
  std::vector<Vec3f> centres;
  std::vector<float> baked;
  for (const Voxel& voxel : volume.voxels) {
    if (voxel.sigma < 0.999f * 400 * float(kCentredFrame.unit_per_world)) continue;  // full: colour of its middle
    const Vec3d world = volume.origin + Vec3d{voxel.i + 0.5, voxel.j + 0.5, voxel.k + 0.5} * volume.voxel_size;
    centres.push_back(kCentredFrame.unit_from_world(world).cast<float>());
    baked.push_back(voxel.luminance);
  }
  ASSERT_GT(baked.size(), 200u);
  const std::vector<float> luminance = averages(*average, centres);
  double different = 0, varied = 0;
  for (std::size_t v = 0; v < baked.size(); ++v) {
    different += std::abs(luminance[v] - baked[v]) / double(baked.size());
    varied += std::abs(baked[v] - 0.4) / double(baked.size());
  }
  EXPECT_GT(varied, 0.05);
  EXPECT_LT(different, 0.001) << "but for a 256th of a voxel";
}

TEST(ViewAverage, DoesNotDependOnThreadsOrOnWhatElseIsAsked) {
  const AnalyticField field = shining_ball();
  const auto average = view_average(field, two_cameras(), few_voxels());
  std::vector<Vec3f> positions;
  for (int i = 0; i < 200; ++i) {
    const float turn = 0.1f * float(i);
    positions.push_back(kMiddle + Vec3f{std::cos(turn), std::sin(turn), 0.002f * float(i)} * 0.24f);
  }
  set_thread_count(1);
  const std::vector<float> together = averages(*average, positions);
  set_thread_count(3);
  EXPECT_EQ(averages(*average, positions), together);
  set_thread_count(0);
  for (std::size_t i = 0; i < positions.size(); ++i) ASSERT_EQ(averages(*average, {positions[i]})[0], together[i]);
}

TEST(ViewAverage, NestedGridsHideOneBehindTheOther) {
  // A near ball in a finer grid stands before a wall in a coarser one.
  const SceneFrame frame{{0, 8, 0}, 1.0 / 16, 2};
  const auto ball = sphere_density({0.5f, 0.125f, 0.5f}, 0.025f, 2000);
  const auto wall = box_density({0.1f, 0.9f, 0.1f}, {0.9f, 0.94f, 0.9f}, 2000);
  AnalyticField field(frame, [=](Vec3f p) { return std::max(ball(p), wall(p)); });
  field.with_luminance([](Vec3f, Vec3f d) { return d.y > 0.9f ? 0.9f : 0.3f; });
  const std::vector<Camera> cameras{camera_at("eye", {0, 0, 0}, {0, 4, 0}, 48, 48, 50),
                                    camera_at("beside", {0.2, 0, 0}, {0.2, 4, 0}, 48, 48, 50)};
  Options options;
  options.resolution = 40;
  ASSERT_GT(plan_levels(field, cameras, options).size(), 1u);
  const auto average = view_average(field, cameras, options);
  const auto luminance = averages(*average, {{0.5f, 0.1f, 0.5f}, {0.6f, 0.9f, 0.5f}, {0.5f, 0.149f, 0.5f}});
  EXPECT_FLOAT_EQ(luminance[0], 0.9f) << "the front of the ball";
  EXPECT_FLOAT_EQ(luminance[1], 0.9f) << "the wall beside it";
  EXPECT_NEAR(luminance[2], (0.9 + 5 * 0.3) / 6, 1e-6) << "the back of the ball: nobody sees it";
}

}  // namespace
}  // namespace cnerf::bake::test
