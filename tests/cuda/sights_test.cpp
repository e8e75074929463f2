// Who sees what of a bake: the GPU against the processor.

#include <gtest/gtest.h>

#include <cmath>

#include "bake/visibility/view_selection.h"
#include "src/base/rng.h"
#include "src/engine/luminance_engine.h"

namespace cnerf::test {
namespace {

/// Fog and specks of matter in about a third of the bricks.
bake::BrickGrid<float> speckled(int side, std::uint64_t seed) {
  SequentialRng rng(seed, 1);
  bake::BrickGrid<float> grid({0, 0, 0}, {side, side - 3, side}, 0.0f);
  for (std::size_t b = 0; b < grid.brick_count(); ++b) {
    if (rng.uniform() > 0.35) continue;
    for (float& sigma : grid.make_brick(b)) {
      sigma = rng.uniform() < 0.3 ? float(40 * rng.uniform()) : float(1.5 * rng.uniform());
    }
  }
  return grid;
}

std::vector<bake::Camera> cameras_around(Vec3d middle, double distance) {
  std::vector<bake::Camera> cameras;
  for (int c = 0; c < 20; ++c) {
    const double angle = 0.7 * c;
    bake::Camera camera;
    const Vec3d back = normalized(Vec3d{std::cos(angle), std::sin(angle), 0.3 * std::cos(2.1 * c)});
    const Vec3d right = normalized(cross(Vec3d{0, 0, 1}, back));
    camera.world_from_camera = {Mat3d::from_columns(right, cross(right, back), -back), middle + back * distance};
    camera.intrinsics = {
        c % 3 == 0 ? LensModel::kOpenCvFisheye : LensModel::kOpenCv, 64, 48, 60, 60, 31, 25, {0.05, -0.02}};
    cameras.push_back(camera);
  }
  return cameras;
}

TEST(Sights, AreThoseOfTheProcessor) {
  if (!has_cuda_device()) GTEST_SKIP() << "no GPU that can be used";
  const bake::BrickGrid<float> fine = speckled(64, 3), coarse = speckled(48, 4);
  const std::vector<bake::DensityLevel> levels = {{&fine, {0, 0, 0}, 0.5}, {&coarse, {-8, -8, -8}, 1}};
  bake::Options options;
  options.views_per_voxel = 5;
  const std::vector<bake::Camera> cameras = cameras_around({16, 16, 16}, 45);
  bake::ViewSelection cpu(cameras, levels, options);
  cpu.map_depths();
  const auto cuda = make_view_selection_cuda(cameras, levels, options);

  bake::SightBatch batch;
  SequentialRng rng(9, 2);
  for (std::uint32_t order = 0; order < 40; ++order) {
    const Vec3d centre{32 * rng.uniform(), 32 * rng.uniform(), 32 * rng.uniform()};
    const auto cameras_in_order = try_order(cpu.eyes(), centre);
    batch.orders.insert(batch.orders.end(), cameras_in_order.begin(), cameras_in_order.end());
    for (int i = 0; i < 500; ++i) {
      const Vec3d beside{4 * rng.uniform(), 4 * rng.uniform(), 4 * rng.uniform()};
      batch.sights.push_back({centre + beside, i % 4 == 0 ? 0.3f : 0.0f, order});
    }
  }
  bake::SeenBatch expected, found;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    cpu.find(level, batch, expected);
    cuda->find(level, batch, found);
    // A position rounded otherwise may fall into the next voxel: single points differ, and little.
    double differing = 0, seen = 0, error = 0;
    for (std::size_t i = 0; i < batch.sights.size(); ++i) {
      bool same = expected.counts[i] == found.counts[i];
      for (int s = 0; same && s < expected.counts[i]; ++s) {
        const bake::SeenBy a = expected.seen[5 * i + s], b = found.seen[5 * i + s];
        same = a.camera == b.camera;
        error = std::max(error, same ? std::abs(double(a.transmittance) - b.transmittance) / a.transmittance : 0.0);
      }
      differing += same ? 0 : 1;
      seen += expected.counts[i] > 0 ? 1 : 0;
    }
    const double count = double(batch.sights.size());
    EXPECT_NEAR(seen / count, 0.5, 0.4) << "neither none nor all are seen";
    EXPECT_LT(differing / count, 2e-3) << "points that others see";  // found: 0 to 5e-5
    EXPECT_LT(error, 0.1) << "transmittance of the same cameras";    // found: 3e-7 to 2e-2
  }
}

}  // namespace
}  // namespace cnerf::test
