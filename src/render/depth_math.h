#pragma once
/// The loss of a ray whose surface's distance is roughly known, from sparse points of structure from motion:
///
///   L = sum_i w_i rho(t_i) + T,   rho(t) = x^2 / (1 + x^2),   x = ln(t / t_known) / width
///
/// Light from where the point is costs nothing, light from elsewhere and what comes from behind all samples up to 1
/// (after DS-NeRF, Deng et al. 2022; rho is Geman's and McClure's, so that a wrong point does little). It is linear in
/// the weights w, and places are logarithms as in distortion_math.h.

#include <cmath>
#include <cstdint>
#include <vector>

#include "src/base/host_device.h"

namespace cnerf {

/// How far the surface is that a pixel shows.
struct DepthHint {
  float log_distance = 0;  ///< ln of the distance from the camera's centre, unit space
  float sharpness = 0;     ///< 1 / width of rho; 0: nothing is known

  [[nodiscard]] CNERF_HD bool is_known() const { return sharpness > 0; }
};

/// Of a picture, coarser than its pixels.
struct DepthHints {
  int columns = 0, rows = 0;
  std::vector<DepthHint> cells;  ///< [rows, columns]
};

/// The cell of `cells` that a pixel lies in, of an axis.
[[nodiscard]] CNERF_HD inline int hint_cell(int pixel, int pixels, int cells) {
  return int(std::int64_t(pixel) * cells / pixels);
}

/// rho, of light from a distance.
template <typename Real>
[[nodiscard]] CNERF_HD Real depth_miss(Real t, const DepthHint& hint) {
  const Real nearest = Real(1e-3);  // of unit space: nothing is seen from closer
  const Real x = (std::log(t < nearest ? nearest : t) - Real(hint.log_distance)) * Real(hint.sharpness);
  return x * x / (Real(1) + x * x);
}

}  // namespace cnerf
