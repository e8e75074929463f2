#pragma once
/// An exponential that compilers turn into vector instructions.

#include <bit>

namespace cnerf {

/// exp(x) of x <= 0, to 3e-7 of it; below -87 that of -87.
[[nodiscard]] inline float exp_of_negative(float x) {
  constexpr float kLog2E = 1.44269504f, kLn2High = 0.693359375f, kLn2Low = -2.12194440e-4f;
  x = x < -87.0f ? -87.0f : x;
  const int n = int(x * kLog2E - 0.5f);
  const float r = (x - float(n) * kLn2High) - float(n) * kLn2Low;  // |r| <= ln(2) / 2
  const float series =
      1 +
      r * (1 + r * (0.5f + r * (1.66666667e-1f + r * (4.16666667e-2f + r * (8.33333333e-3f + r * 1.38888889e-3f)))));
  return series * std::bit_cast<float>((n + 127) << 23);
}

}  // namespace cnerf
