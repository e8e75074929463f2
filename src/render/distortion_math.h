#pragma once
/// How far apart the samples lie that make up a ray's colour, and its derivative: the distortion loss of Mip-NeRF 360
/// (Barron et al. 2022, Eq. 15). A ray that meets one surface has none; fog along it, or a floater in front of it,
/// does. Places on a ray are logarithms of the distance, so that the scale of the scene does not matter and far things
/// are not told from things a little farther.

#include <cmath>

#include "src/base/host_device.h"

namespace cnerf {

/// Where a sample lies for the distortion, and how much of a ray it stands for.
template <typename Real>
struct LogInterval {
  Real place = 0;   ///< log t
  Real extent = 0;  ///< dt / t

  CNERF_HD LogInterval(Real t, Real dt) {
    const Real nearest = Real(1e-3);  // of unit space: nothing is seen from closer
    t = t < nearest ? nearest : t;
    place = std::log(t);
    extent = dt / t;
  }
};

/// Sums over samples in front-to-back order: D = sum_ij w_i w_j |m_i - m_j| + 1/3 sum_i w_i^2 e_i.
template <typename Real>
struct Distortion {
  Real weight = Real(0);  ///< sum of w
  Real moment = Real(0);  ///< sum of w m
  Real value = Real(0);   ///< D so far

  CNERF_HD void add(Real w, const LogInterval<Real>& at) {
    value += Real(2) * w * (at.place * weight - moment) + w * w * at.extent / Real(3);
    weight += w;
    moment += w * at.place;
  }
};

/// dD / dw_i.
/// @param weight_before, moment_before  sums over the samples in front of i
/// @param all                           of the whole ray
template <typename Real>
CNERF_HD Real distortion_derivative(Real w, const LogInterval<Real>& at, Real weight_before, Real moment_before,
                                    const Distortion<Real>& all) {
  const Real weight_balance = Real(2) * weight_before + w - all.weight;  // before minus behind
  const Real moment_balance = Real(2) * moment_before + w * at.place - all.moment;
  return Real(2) * (at.place * weight_balance - moment_balance) + Real(2) / Real(3) * w * at.extent;
}

}  // namespace cnerf
