#pragma once
/// Output activations of stage 1's nets: density and luminance.

#include <cmath>

#include "src/base/host_device.h"
#include "src/color/colorspace_math.h"

namespace cnerf {

/// Density, 1/unit length, from the density net's first output. Clamped so that neither sigma nor its gradient
/// overflows.
template <typename Real>
CNERF_HD Real density_from_raw(Real raw, Real scale) {
  const Real most = Real(15);
  return std::exp(raw > most ? most : raw < -most ? -most : raw) * scale;
}

/// The luminance net predicts L*, in which the loss is measured: the gradient then vanishes only at both ends of the
/// sigmoid, and dark captures learn as fast as bright ones.
template <typename Real>
struct LuminanceActivation {
  Real brightest;  ///< L* at sigmoid = 1; above 100 for light brighter than white

  /// @param luminance  linear luminance of the brightest pixel; samples may emit a little more
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
