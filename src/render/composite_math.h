#pragma once
/// Emission-absorption compositing (paper, Eq. vol rendering) and its derivative, for one ray.

#include <cmath>

#include "src/base/host_device.h"

namespace cnerf {

/// Opacity of an interval: 1 - exp(-sigma dt).
template <typename Real>
CNERF_HD Real alpha_of(Real sigma, Real dt) {
  return Real(1) - std::exp(-sigma * dt);
}

/// Front-to-back accumulation of one channel.
template <typename Real>
struct Compositor {
  Real transmittance = Real(1);  ///< T before the next sample
  Real value = Real(0);          ///< sum of w v so far

  /// Adds a sample; returns its weight w = T alpha.
  CNERF_HD Real add(Real alpha, Real sample_value) {
    const Real weight = transmittance * alpha;
    value += weight * sample_value;
    transmittance *= Real(1) - alpha;
    return weight;
  }
};

/// d(value) / d(sigma_i) of a composited channel: dt (T_{i+1} v_i - suffix_i).
/// @param transmittance_after  T_{i+1}
/// @param suffix  what samples behind i and the background add to the pixel: sum_{j>i} w_j v_j + T_end v_bg
template <typename Real>
CNERF_HD Real density_derivative(Real dt, Real transmittance_after, Real sample_value, Real suffix) {
  return dt * (transmittance_after * sample_value - suffix);
}

}  // namespace cnerf
