#pragma once
/// The shape of stage 1's field, the same on every device, and density of its raw output.

#include <cmath>

#include "src/base/host_device.h"

namespace cnerf {

inline constexpr int kGeometryChannels = 16;  ///< outputs of the density net; the first one is log density
inline constexpr int kHiddenWidth = 64;

/// Density of the density net's first output; 1/unit length. Clamped so that neither sigma nor its gradient overflows.
template <typename Real>
CNERF_HD Real density_from_raw(Real raw, Real scale) {
  const Real most = Real(15);
  return std::exp(raw > most ? most : raw < -most ? -most : raw) * scale;
}

}  // namespace cnerf
