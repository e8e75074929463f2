// The lattice by number against the same lattice walked step by step.

#include "src/render/march_lattice.h"

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

}  // namespace
}  // namespace cnerf
