#include "bake/visibility/view_selection.h"

#include <gtest/gtest.h>

#include <numeric>

#include "src/base/rng.h"
#include "tests/bake/analytic_field.h"

namespace cnerf::bake::test {
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
    const Vec3f from{1.3f, 3.0f + float(i), 40.2f};
    const Vec3f to{61.0f, 60.0f - float(i), 3.7f};
    EXPECT_NEAR(transmittance_between(sparse, 1, from, to, 1e-6f), transmittance_between(full, 1, from, to, 1e-6f),
                1e-6f);
  }
}

/// A few bricks of noise in a box whose sides are no multiples of a brick's. None at its lower faces: a ray that leaves
/// there may count the last voxel twice.
BrickGrid<float> scattered(const Vec3i& min, int bricks, CounterRng rng) {
  BrickGrid<float> grid(min, {101, 77, 90}, 0.0f);
  for (int i = 0; i < bricks; ++i) {
    const Vec3i low = grid.brick_min(rng.below(std::uint64_t(i), std::uint32_t(grid.brick_count())));
    for (int v = 0; v < kBrickVoxels; ++v) {
      const Vec3i voxel = low + brick_local(v);
      const Vec3i inner = voxel - Vec3i{1, 1, 1};
      if (grid.contains(voxel) && grid.contains(inner))
        grid.set(voxel, 0.05f * rng.uniform(1000 * std::uint64_t(i + 1) + std::uint64_t(v)));
    }
  }
  return grid;
}

/// Every whole step, none skipped.
float transmittance_by_all_steps(const BrickGrid<float>& grid, Vec3f from, Vec3f to, float stop_below) {
  const float distance = length(to - from);
  const Vec3f d = (to - from) / distance, start = from - grid.min().cast<float>();
  float depth = 0;
  for (float t = 1; t < distance; t += 1) {
    const Vec3f p = start + d * t;
    if (sight::inside(p, grid.size().cast<float>())) depth += grid.at(grid.min() + p.cast<int>());
    if (depth > -std::log(stop_below)) return 0;
  }
  return std::exp(-depth);
}

TEST(Transmittance, ClearSpaceIsLeftInFewStepsAndToTheSameBits) {
  const CounterRng rng(4, 1);
  for (const int bricks : {0, 1, 5, 40, 400}) {
    const BrickGrid<float> grid = scattered({-7, 3, 11}, bricks, rng);
    const ClearGrid clear(grid);
    int dimmed = 0;
    for (std::uint64_t i = 0; i < 2000; ++i) {
      const auto point = [&](std::uint64_t at, float reach) {
        const Vec3f share{rng.uniform(at), rng.uniform(at + 1), rng.uniform(at + 2)};
        return Vec3f{40, 40, 55} + (share - Vec3f{0.5f, 0.5f, 0.5f}) * reach;
      };
      const Vec3f from = point(9000000 + 6 * i, 90), to = point(9000003 + 6 * i, i % 2 == 0 ? 90 : 2000);
      const float exact = transmittance_by_all_steps(grid, from, to, 1e-3f);
      ASSERT_EQ(transmittance_between(clear, 1, from, to, 1e-3f), exact) << bricks << " bricks, ray " << i;
      ASSERT_EQ(transmittance_between(grid, 1, from, to, 1e-3f), exact) << bricks << " bricks, ray " << i;
      dimmed += exact < 1 ? 1 : 0;
    }
    EXPECT_EQ(dimmed > 0, bricks > 0);
  }
}

TEST(ClearGrid, KnowsHowFarTheNextBrickIs) {
  const BrickGrid<float> grid = scattered({0, 0, 0}, 3, CounterRng(8, 1));
  const ClearGrid clear(grid);
  const Vec3i counts = grid.brick_counts();
  for (std::size_t b = 0; b < grid.brick_count(); ++b) {
    const Vec3i at = grid.brick_coordinates(b);
    int nearest = 1000;
    for (std::size_t other = 0; other < grid.brick_count(); ++other) {
      const Vec3i way = grid.brick_coordinates(other) - at;
      if (!grid.has_brick(other)) continue;
      nearest = std::min(nearest, std::max({std::abs(way.x), std::abs(way.y), std::abs(way.z)}));
    }
    EXPECT_EQ(clear.clear_bricks(at * kBrickSide), std::max(0, nearest - 1)) << at.x << ' ' << at.y << ' ' << at.z;
  }
  EXPECT_GT(counts.x * counts.y * counts.z, 1000);
}

struct Ring {
  Plan plan;
  std::vector<Camera> cameras;
};

/// Eight cameras around the middle of a lattice of 64^3 voxels of size 1.
Ring ring(int pixels = 64) {
  Ring r;
  r.plan.voxel_size = 1;
  r.plan.resolution = {64, 64, 64};
  const Vec3d middle{32, 32, 32};
  for (int c = 0; c < 8; ++c) {
    const double angle = c * 3.14159265358979 / 4;
    r.cameras.push_back(camera_at("ring", middle + Vec3d{std::cos(angle), std::sin(angle), 0} * 200.0, middle, pixels,
                                  pixels, 2 * pixels));
  }
  return r;
}

/// Who sees points of the ring's lattice, filled with `sigma`.
ViewSelection onlookers(const Ring& r, const BrickGrid<float>& sigma, int views) {
  Options options;
  options.views_per_voxel = views;
  return {r.cameras, {{&sigma, r.plan.origin, r.plan.voxel_size}}, options};
}

TEST(ViewSelection, TriesOppositeCamerasEarly) {
  const std::vector<std::int32_t> order = try_order(eyes_of(ring().cameras), {32, 32, 32});
  ASSERT_EQ(order.size(), 8u);
  EXPECT_EQ((order[1] - order[0] + 8) % 8, 4);
  EXPECT_EQ((order[2] - order[0] + 8) % 4, 2) << "then at right angles";
}

TEST(ViewSelection, FindsTheCamerasOnTheRightSideOfAWall) {
  const BrickGrid<float> sigma = wall(8, 50);
  const ViewSelection views = onlookers(ring(), sigma, 16);
  const Vec3d at{32.5, 32.5, 32.5};  // the wall's face towards -x: camera 4 and its neighbours
  const std::vector<SeenBy> seen = views.seen_by(0, at, try_order(views.eyes(), at));
  ASSERT_EQ(seen.size(), 3u);
  for (const SeenBy& view : seen) EXPECT_TRUE(view.camera >= 3 && view.camera <= 5) << view.camera;
}

TEST(ViewSelection, KeepsToTheLimitAndToThePicture) {
  const BrickGrid<float> nothing({0, 0, 0}, {64, 64, 64}, 0.0f);
  const ViewSelection views = onlookers(ring(), nothing, 3);
  EXPECT_EQ(views.seen_by(0, {32, 32, 32}, try_order(views.eyes(), {32, 32, 32})).size(), 3u);
  // Far above the ring: outside of every picture (field of view 28 degrees).
  EXPECT_TRUE(views.seen_by(0, {32, 32, 300}, try_order(views.eyes(), {32, 32, 300})).empty());
}

TEST(ViewSelection, KeepsTheBestOfMoreThanItWants) {
  // Fog, so that cameras see the same point through more or less of it.
  BrickGrid<float> fog({0, 0, 0}, {64, 64, 64}, 0.0f);
  for (std::size_t b = 0; b < fog.brick_count(); ++b) fog.make_brick(b).fill(0.05f);
  const Vec3d at{50.5, 20.5, 32.5};
  const ViewSelection all = onlookers(ring(), fog, 8), best = onlookers(ring(), fog, 2);
  const std::vector<SeenBy> of_all = all.seen_by(0, at, try_order(all.eyes(), at));
  const std::vector<SeenBy> of_best = best.seen_by(0, at, try_order(best.eyes(), at));
  ASSERT_EQ(of_all.size(), 8u);
  ASSERT_EQ(of_best.size(), 2u);
  for (std::size_t i = 1; i < of_all.size(); ++i) EXPECT_LE(of_all[i].transmittance, of_all[i - 1].transmittance);
  EXPECT_GT(of_all.front().transmittance, 2 * of_all.back().transmittance) << "the fog is no test";
  EXPECT_EQ(of_best[1].camera, of_all[1].camera) << "found after dimmer ones, and before them in the answer";
  EXPECT_EQ(of_best[0].camera, of_all[0].camera);
}

/// Of points, with maps of depth and without.
struct WithMaps {
  int seen = 0;       ///< without maps
  int lost = 0;       ///< of these, with them
  int differing = 0;  ///< by other cameras, or more or less dimly, or not at all
};

WithMaps asked_with_maps(const Ring& r, const BrickGrid<float>& sigma, const std::vector<Vec3d>& points) {
  const ViewSelection plain = onlookers(r, sigma, 3);
  ViewSelection mapped = onlookers(r, sigma, 3);
  mapped.map_depths();
  SightBatch batch;
  batch.orders = try_order(plain.eyes(), {32, 32, 32});
  for (const Vec3d& point : points) batch.sights.push_back({point, 0, 0});
  SeenBatch expected, found;
  plain.find(0, batch, expected);
  mapped.find(0, batch, found);
  WithMaps result;
  for (std::size_t i = 0; i < points.size(); ++i) {
    bool is_same = expected.counts[i] == found.counts[i];
    for (std::size_t s = 3 * i; is_same && s < 3 * i + std::size_t(expected.counts[i]); ++s) {
      is_same = expected.seen[s].camera == found.seen[s].camera &&
                expected.seen[s].transmittance == found.seen[s].transmittance;
    }
    result.differing += is_same ? 0 : 1;
    result.seen += expected.counts[i] > 0 ? 1 : 0;
    result.lost += expected.counts[i] > 0 && found.counts[i] == 0 ? 1 : 0;
  }
  return result;
}

std::vector<Vec3d> voxel_centres() {
  std::vector<Vec3d> centres;
  for (int i = 0; i < 64; ++i)
    for (int j = 0; j < 64; ++j)
      for (int k = 0; k < 64; ++k) centres.push_back({i + 0.5, j + 0.5, k + 0.5});
  return centres;
}

TEST(DepthMaps, OfAWallEndWithinIt) {
  const Ring r = ring();
  const BrickGrid<float> sigma = wall(20, 50);
  ViewSelection views = onlookers(r, sigma, 3);
  views.map_depths();
  const Eye& eye = views.eyes()[4];  // 200 from the middle, towards -x
  for (const double inside : {0.5, 1.5}) EXPECT_FALSE(eye.depths.hides({32, 32}, 200 + inside)) << inside;
  for (const double inside : {3.5, 10.0, 100.0}) EXPECT_TRUE(eye.depths.hides({32, 32}, 200 + inside)) << inside;
  EXPECT_FALSE(views.eyes()[2].depths.hides({60, 32}, 1e6)) << "beside the wall";
}

TEST(DepthMaps, ChangeNothingOfAWall) {
  const WithMaps asked = asked_with_maps(ring(), wall(20, 50), voxel_centres());
  EXPECT_EQ(asked.differing, 0);
  EXPECT_GT(asked.seen, 100000);
}

TEST(DepthMaps, ChangeNothingInFog) {
  BrickGrid<float> fog({0, 0, 0}, {64, 64, 64}, 0.0f);
  for (std::size_t b = 0; b < fog.brick_count(); ++b) fog.make_brick(b).fill(0.3f);
  const WithMaps asked = asked_with_maps(ring(), fog, voxel_centres());
  EXPECT_EQ(asked.differing, 0);
  EXPECT_GT(asked.seen, 50000);
  EXPECT_LT(asked.seen, 64 * 64 * 64);
}

TEST(DepthMaps, OfSpecksLoseFewPoints) {
  const CounterRng rng(6, 1);
  BrickGrid<float> sigma({0, 0, 0}, {64, 64, 64}, 0.0f);
  for (int i = 0; i < 64; ++i)
    for (int j = 0; j < 64; ++j)
      for (int k = 0; k < 64; ++k) {
        const auto at = std::uint64_t(64 * (64 * i + j) + k);
        if (rng.uniform(at) < 0.1) sigma.set({i, j, k}, 20);
      }
  const WithMaps asked = asked_with_maps(ring(256), sigma, voxel_centres());
  EXPECT_LT(asked.lost, asked.seen / 30) << "gaps between specks are finer than cells";
  EXPECT_LT(asked.differing, asked.seen / 10);
  EXPECT_GT(asked.seen, 20000);
}

/// Cameras that order_for leaves out for the bricks of the ring's lattice, each of which must see nothing of its brick.
int left_out_for_bricks(const Ring& r, const BrickGrid<float>& sigma) {
  ViewSelection views = onlookers(r, sigma, 8);
  views.map_depths();
  const std::vector<std::int32_t> all = try_order(views.eyes(), {32, 32, 32});
  int left_out = 0;
  for (std::size_t b = 0; b < sigma.brick_count(); ++b) {
    const Vec3d low = sigma.brick_min(b).cast<double>(), half{4, 4, 4};
    const std::vector<std::int32_t> order = views.order_for(low + half, length(half));
    left_out += int(std::ranges::count(order, -1));
    for (int p = 0; p < kBrickVoxels; p += 7) {
      const Vec3d at = low + brick_local(p).cast<double>() + half / 8.0;
      EXPECT_EQ(views.seen_by(0, at, order).size(), views.seen_by(0, at, all).size())
          << at.x << ' ' << at.y << ' ' << at.z;
    }
  }
  return left_out;
}

TEST(DepthMaps, LeaveOutNoCameraThatSeesAPointOfABrick) {
  BrickGrid<float> blocks({0, 0, 0}, {64, 64, 64}, 0.0f);
  for (std::size_t b = 0; b < blocks.brick_count(); ++b) {
    if (CounterRng(5, 1).uniform(b) < 0.5) blocks.make_brick(b).fill(50);
  }
  EXPECT_GT(left_out_for_bricks(ring(256), wall(20, 50)), 100);
  EXPECT_GT(left_out_for_bricks(ring(256), blocks), 100);
  // Close by, through wide lenses: some bricks surround the camera, lie behind it or beside its picture.
  for (const LensModel model : {LensModel::kPinhole, LensModel::kOpenCv, LensModel::kOpenCvFisheye}) {
    Ring near = ring(256);
    for (Camera& camera : near.cameras) {
      camera.world_from_camera.translation =
          Vec3d{32, 32, 32} + (camera.world_from_camera.translation - Vec3d{32, 32, 32}) * 0.2;
      camera.intrinsics = {model, 256, 256, 140, 140, 128, 128, {0.15}};
      if (model == LensModel::kPinhole) camera.intrinsics.distortion = {};
    }
    EXPECT_GT(left_out_for_bricks(near, blocks), 100) << int(model);
  }
}

TEST(ViewSelection, FindsTheOneCameraOfManyThatSeesAPoint) {
  Ring r = ring();
  r.cameras.assign(40, r.cameras[0]);
  r.cameras[39] = ring().cameras[4];
  const BrickGrid<float> sigma = wall(8, 50);
  ViewSelection views = onlookers(r, sigma, 3);
  views.map_depths();
  std::vector<std::int32_t> order(40);
  std::iota(order.begin(), order.end(), 0);
  const std::vector<SeenBy> seen = views.seen_by(0, {32.5, 32.5, 32.5}, order);  // the wall's face towards -x
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].camera, 39);
}

TEST(ViewSelection, ManyPointsAreAnsweredLikeOneByOne) {
  const BrickGrid<float> sigma = wall(4, 0.4f);
  const ViewSelection views = onlookers(ring(), sigma, 3);
  SightBatch batch;
  for (int i = 0; i < 700; ++i) {
    const Vec3d at{1.0 + i % 61, 1.0 + i % 53, 1.0 + i % 59};
    batch.sights.push_back({at, i % 3 == 0 ? 0.6f : 0.0f, std::uint32_t(i % 2)});
  }
  for (const Vec3d centre : {Vec3d{10, 10, 10}, Vec3d{50, 50, 50}}) {
    const auto order = try_order(views.eyes(), centre);
    batch.orders.insert(batch.orders.end(), order.begin(), order.end());
  }
  SeenBatch answer;
  views.find(0, batch, answer);
  for (std::size_t i = 0; i < batch.sights.size(); ++i) {
    const Sight& sight = batch.sights[i];
    const auto order = std::span(batch.orders).subspan(8 * sight.order, 8);
    const std::vector<SeenBy> seen = views.seen_by(0, sight.world, order, sight.least);
    ASSERT_EQ(answer.counts[i], int(seen.size()));
    for (std::size_t s = 0; s < seen.size(); ++s) EXPECT_EQ(answer.seen[3 * i + s].camera, seen[s].camera);
  }
}

}  // namespace
}  // namespace cnerf::bake::test
