#pragma once
/// A texture that features are found on.

#include <cmath>
#include <cstdint>

#include "src/base/rng.h"

namespace cnerf::test {

/// Of 0 to 1, with blobs of every size from a tenth of a unit on.
inline double smooth_noise(double x, double y) {
  double value = 0;
  for (int octave = 0; octave < 4; ++octave) {
    const double scale = 3 << octave;
    const CounterRng rng(1, std::uint64_t(octave));
    const auto corner = [&](int i, int j) {
      return rng.uniform(std::uint64_t(i + 4096) * 8192 + std::uint64_t(j + 4096));
    };
    const int i = int(std::floor(x * scale)), j = int(std::floor(y * scale));
    const double u = x * scale - i, v = y * scale - j;
    value += ((1 - u) * (1 - v) * corner(i, j) + u * (1 - v) * corner(i + 1, j) + (1 - u) * v * corner(i, j + 1) +
              u * v * corner(i + 1, j + 1)) /
             4;
  }
  return value;
}

}  // namespace cnerf::test
