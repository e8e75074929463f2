#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "encoding/spherical_harmonics_math.h"

namespace cnerf {
namespace {

std::array<double, kSphericalHarmonics> evaluate(double theta, double phi) {
  std::array<double, kSphericalHarmonics> values{};
  spherical_harmonics(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta),
                      [&](int i, double value) { values[i] = value; });
  return values;
}

/// Integral over the sphere of the product of every two functions: the identity, for an orthonormal set.
TEST(SphericalHarmonics, AreOrthonormal) {
  constexpr int kTheta = 200, kPhi = 64;
  std::array<std::array<double, kSphericalHarmonics>, kSphericalHarmonics> gram{};
  for (int i = 0; i < kTheta; ++i) {
    const double theta = (i + 0.5) * std::numbers::pi / kTheta;
    const double area = std::sin(theta) * (std::numbers::pi / kTheta) * (2 * std::numbers::pi / kPhi);
    for (int j = 0; j < kPhi; ++j) {
      const auto y = evaluate(theta, j * 2 * std::numbers::pi / kPhi);
      for (int a = 0; a < kSphericalHarmonics; ++a) {
        for (int b = 0; b < kSphericalHarmonics; ++b) gram[a][b] += area * y[a] * y[b];
      }
    }
  }
  for (int a = 0; a < kSphericalHarmonics; ++a) {
    for (int b = 0; b < kSphericalHarmonics; ++b) EXPECT_NEAR(gram[a][b], a == b ? 1.0 : 0.0, 5e-4) << a << ' ' << b;
  }
}

}  // namespace
}  // namespace cnerf
