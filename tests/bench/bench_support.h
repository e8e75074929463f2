#pragma once
/// What the benchmarks of single paths share: a trace of positions as training sees them, and honest clocks.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "src/base/rng.h"
#include "src/base/vec3.h"

namespace cnerf::bench {

/// The best of `repeats` calls, seconds. A machine that others use too only ever adds time.
template <typename Work>
double best_seconds(int repeats, Work&& work) {
  double best = 1e30;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

/// [n, 3] positions along random rays through the unit cube, `spacing` apart: ray by ray, as a step visits them.
inline std::vector<float> positions_along_rays(std::size_t n, float spacing, std::uint64_t seed) {
  std::vector<float> positions;
  SequentialRng rng(seed, 1);
  while (positions.size() < 3 * n) {
    const Vec3f from = {rng.uniform(), rng.uniform(), rng.uniform()},
                to = {rng.uniform(), rng.uniform(), rng.uniform()};
    const float distance = length(to - from);
    for (float t = 0; t < distance && positions.size() < 3 * n; t += spacing) {
      const Vec3f p = from + (to - from) * (t / distance);
      positions.insert(positions.end(), {p.x, p.y, p.z});
    }
  }
  return positions;
}

/// Ends the program when what is about to be timed is wrong.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not timed: %s\n", what);
  std::exit(1);
}

}  // namespace cnerf::bench
