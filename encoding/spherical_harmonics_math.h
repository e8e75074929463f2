#pragma once
/// Real spherical harmonics of degree 0 to 3 (16 functions) of a unit direction, the direction encoding.

#include "src/base/host_device.h"

namespace cnerf {

inline constexpr int kSphericalHarmonics = 16;

/// Orthonormal over the sphere, without the Condon-Shortley phase. `out(i, value)` receives the i-th value.
template <typename Real, typename Out>
CNERF_HD void spherical_harmonics(Real x, Real y, Real z, Out&& out) {
  const Real xx = x * x, yy = y * y, zz = z * z;
  out(0, Real(0.28209479177387814));
  out(1, Real(0.4886025119029199) * y);
  out(2, Real(0.4886025119029199) * z);
  out(3, Real(0.4886025119029199) * x);
  out(4, Real(1.0925484305920792) * x * y);
  out(5, Real(1.0925484305920792) * y * z);
  out(6, Real(0.31539156525252005) * (Real(3) * zz - Real(1)));
  out(7, Real(1.0925484305920792) * x * z);
  out(8, Real(0.5462742152960396) * (xx - yy));
  out(9, Real(0.5900435899266435) * y * (Real(3) * xx - yy));
  out(10, Real(2.890611442640554) * x * y * z);
  out(11, Real(0.4570457994644658) * y * (Real(5) * zz - Real(1)));
  out(12, Real(0.3731763325901154) * z * (Real(5) * zz - Real(3)));
  out(13, Real(0.4570457994644658) * x * (Real(5) * zz - Real(1)));
  out(14, Real(1.445305721320277) * z * (xx - yy));
  out(15, Real(0.5900435899266435) * x * (xx - Real(3) * yy));
}

}  // namespace cnerf
