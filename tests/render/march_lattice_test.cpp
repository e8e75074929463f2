// The lattice by number against the same lattice walked step by step.

#include "src/render/march.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace cnerf {
namespace {

/// Largest distance, in steps, between the closed form and a walk in double, up to t = `end`.
double worst_distance(const MarchSettings& settings, float begin, float jitter, double end) {
  const MarchLattice lattice(settings, begin, jitter);
  double t = begin + jitter * lattice.step(begin), worst = 0;
  for (int index = 0; t < end; ++index) {
    const double dt = std::clamp(double(settings.cone_angle) * t, double(settings.dt_min), double(settings.dt_max));
    worst = std::max(worst, std::abs(t - lattice.t_at(index)) / dt);
    t += dt;
  }
  return worst;
}

TEST(MarchLattice, EqualsAWalkWithConstantSteps) {
  for (const float begin : {0.0f, 0.3f}) {
    EXPECT_LT(worst_distance(march_settings(1, 512, 1.0 / 128), begin, 0.4f, 1.8), 1e-3);
  }
}

TEST(MarchLattice, EqualsAWalkThroughConstantGrowingAndConstantSteps) {
  const MarchSettings settings = march_settings(3, 256, 1.0 / 64);  // grows from t = 1/16 on, up to t = 1
  // Float rounding of the exponent: about 1e-6 of t, which is 64 steps of t / 64.
  for (const float begin : {0.0f, 0.01f, 0.1f, 0.9f, 1.2f}) {
    for (const float jitter : {0.0f, 0.7f}) EXPECT_LT(worst_distance(settings, begin, jitter, 2.0), 1e-3);
  }
  MarchSettings other = settings;
  other.cone_angle *= 1.1f;
  EXPECT_NEAR(MarchLattice(other, 0.5f, 0).step(0.5f), 1.1f * MarchLattice(settings, 0.5f, 0).step(0.5f), 1e-6f);
}

TEST(MarchLattice, KnowsTheNumbersOfItsPoints) {
  for (const int cascades : {1, 3}) {
    const MarchSettings settings = march_settings(cascades, 256, 1.0 / 64);
    const MarchLattice lattice(settings, 0.01f, 0.3f);
    for (int index = 0; index < 400; ++index) {
      const float t = lattice.t_at(index);
      EXPECT_EQ(lattice.index_at(t + 0.5f * lattice.step(t)), index + 1);
      EXPECT_EQ(lattice.index_at(t - 0.5f * lattice.step(t)), index);
    }
  }
}

TEST(RayMarcher, VisitsTheOccupiedPointsOfTheLattice) {
  for (const int cascades : {1, 3}) {
    OccupancyOptions options;
    options.resolution = 32;
    OccupancyGrid grid(options, cascades);
    grid.update({1, 0, 7}, [](std::span<const Vec3f> points, std::span<float> sigma) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        const bool in_ball = length(points[i] - Vec3f{0.45f, 0.5f, 0.62f}) < 0.2f;
        sigma[i] = in_ball || points[i].x > 0.9f ? 1000.0f : 0.0f;
      }
    });
    const MarchSettings settings = march_settings(cascades, 128, 1.0 / 64);
    const Ray ray{{-0.3f, 0.41f, 0.5f}, normalized(Vec3f{1, 0.07f, 0.13f})};
    const auto inside = intersect(Aabbf{{0, 0, 0}, {1, 1, 1}}, ray.origin, ray.direction);
    ASSERT_TRUE(inside);
    const MarchLattice lattice(settings, inside->begin, 0.6f);
    RayMarcher marcher(grid, settings, ray, 0.6f);
    RaySample sample;
    int visited = 0, skipped = 0;
    for (int index = 0; lattice.t_at(index) < inside->end; ++index) {
      const float t = lattice.t_at(index);
      const Vec3f p = ray.at(t);
      if (!grid.occupied(grid.cascade_of(p), p)) {
        ++skipped;
        continue;
      }
      ASSERT_TRUE(marcher.next(sample)) << index;
      EXPECT_EQ(sample.t, t);
      EXPECT_EQ(sample.dt, lattice.step(t));
      ++visited;
    }
    EXPECT_FALSE(marcher.next(sample));
    EXPECT_GT(visited, 20);
    EXPECT_GT(skipped, 20);
  }
}

}  // namespace
}  // namespace cnerf
