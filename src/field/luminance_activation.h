#pragma once
/// From the outputs of stage 1's nets to density and light.

#include <cmath>

#include "src/base/host_device.h"
#include "src/color/colorspace_math.h"

namespace cnerf {

/// Density of the density net's first output; 1/unit length. Clamped so that neither sigma nor its gradient overflows.
template <typename Real>
CNERF_HD Real density_from_raw(Real raw, Real scale) {
  const Real most = Real(15);
  return std::exp(raw > most ? most : raw < -most ? -most : raw) * scale;
}

/// The luminance net answers in L*, as the loss asks: the gradient then fades only at both ends of the sigmoid, and a
/// dark capture learns as fast as a bright one.
template <typename Real>
struct LuminanceActivation {
  Real brightest;  ///< L* at sigmoid = 1; above 100 for light brighter than white

  /// @param luminance  the brightest that images hold, linear; samples may emit a little more
  [[nodiscard]] static LuminanceActivation up_to(Real luminance) {
    return {lightness_from_luminance(Real(1.05) * luminance)};
  }
  /// Linear luminance Y of the net's raw output.
  [[nodiscard]] CNERF_HD Real value(Real raw) const { return luminance_from_lightness(brightest * sigmoid(raw)); }
  [[nodiscard]] CNERF_HD Real derivative(Real raw) const {
    const Real s = sigmoid(raw);
    return luminance_derivative(brightest * s) * brightest * s * (Real(1) - s);
  }

 private:
  [[nodiscard]] CNERF_HD static Real sigmoid(Real raw) { return Real(1) / (Real(1) + std::exp(-raw)); }
};

}  // namespace cnerf
