#pragma once
/// From the luminance net's output to light. The net answers in L*, as the loss asks: the gradient then fades only at
/// both ends of the sigmoid, and a dark capture learns as fast as a bright one.

#include <cmath>

#include "src/base/host_device.h"
#include "src/color/colorspace_math.h"

namespace cnerf {

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
