#pragma once
/// sRGB, linear Rec.709, XYZ and CIE 1976 L*a*b* (D65, 2 degrees). Own conversions, because a monochrome project needs
/// grey to give a = b = 0 exactly; greys are exact here since a and b are computed from ratios to the white point that
/// the matrix rows sum to.

#include <algorithm>
#include <cmath>

#include "src/base/host_device.h"
#include "src/base/vec3.h"

namespace cnerf {

/// CIE 15: the cube root is replaced by a line below epsilon. The slope near black is kappa per unit of luminance.
template <typename Real>
struct LabConstants {
  static constexpr Real epsilon = Real(216.0 / 24389.0);
  static constexpr Real kappa = Real(24389.0 / 27.0);
};

/// IEC 61966-2-1. Works on any finite value; negative ones keep their sign.
template <typename Real>
CNERF_HD Real srgb_from_linear(Real linear) {
  const Real v = std::abs(linear);
  const Real encoded = v <= Real(0.0031308) ? Real(12.92) * v : Real(1.055) * std::pow(v, Real(1 / 2.4)) - Real(0.055);
  return std::copysign(encoded, linear);
}
template <typename Real>
CNERF_HD Real linear_from_srgb(Real encoded) {
  const Real v = std::abs(encoded);
  const Real linear = v <= Real(0.04045) ? v / Real(12.92) : std::pow((v + Real(0.055)) / Real(1.055), Real(2.4));
  return std::copysign(linear, encoded);
}

/// The function f of L* = 116 f(Y) - 16, a = 500 (f(X) - f(Y)), b = 200 (f(Y) - f(Z)), on tristimulus relative to
/// white.
template <typename Real>
CNERF_HD Real lab_f(Real t) {
  return t > LabConstants<Real>::epsilon ? std::cbrt(t) : (LabConstants<Real>::kappa * t + Real(16)) / Real(116);
}
/// f'(t).
template <typename Real>
CNERF_HD Real lab_f_derivative(Real t) {
  if (t <= LabConstants<Real>::epsilon) return LabConstants<Real>::kappa / Real(116);
  const Real root = std::cbrt(t);
  return Real(1) / (Real(3) * root * root);
}
template <typename Real>
CNERF_HD Real lab_f_inverse(Real f) {
  const Real cube = f * f * f;
  return cube > LabConstants<Real>::epsilon ? cube : (Real(116) * f - Real(16)) / LabConstants<Real>::kappa;
}

/// L*, 0..100, of linear luminance Y (white = 1), and its derivative.
template <typename Real>
CNERF_HD Real lightness_from_luminance(Real y) {
  return Real(116) * lab_f(y) - Real(16);
}
template <typename Real>
CNERF_HD Real lightness_derivative(Real y) {
  return Real(116) * lab_f_derivative(y);
}
template <typename Real>
CNERF_HD Real luminance_from_lightness(Real lightness) {
  return lab_f_inverse((lightness + Real(16)) / Real(116));
}

/// Rec.709 luma coefficients of linear light: the Y row of the RGB -> XYZ matrix.
template <typename Real>
CNERF_HD Real luminance_of(Vec3<Real> rgb) {
  return Real(0.2126729) * rgb.x + Real(0.7151522) * rgb.y + Real(0.0721749) * rgb.z;
}

/// XYZ relative to white, (X/Xn, Y, Z/Zn), of linear Rec.709. Rows sum to 1, so that grey maps to three equal numbers.
template <typename Real>
CNERF_HD Vec3<Real> relative_xyz_from_linear_rgb(Vec3<Real> rgb) {
  // sRGB/Rec.709 primaries, D65 white (0.95047, 1, 1.08883), each row divided by its sum.
  return {Real(0.4339530) * rgb.x + Real(0.3762190) * rgb.y + Real(0.1898280) * rgb.z, luminance_of(rgb),
          Real(0.0177578) * rgb.x + Real(0.1094756) * rgb.y + Real(0.8727666) * rgb.z};
}
/// Inverse of `relative_xyz_from_linear_rgb`.
template <typename Real>
CNERF_HD Vec3<Real> linear_rgb_from_relative_xyz(Vec3<Real> xyz);

template <typename Real>
struct Lab {
  Real lightness{}, a{}, b{};  ///< L* 0..100; a, b about -110..110
};

template <typename Real>
CNERF_HD Lab<Real> lab_from_linear_rgb(Vec3<Real> rgb);
/// May leave the gamut: components below 0 or above 1.
template <typename Real>
CNERF_HD Vec3<Real> linear_rgb_from_lab(Lab<Real> lab);
/// Like `linear_rgb_from_lab`, but chroma is scaled down at constant lightness and hue until every component is in
/// [0, max(1, Y)]; channels are never clipped (that would change the hue).
template <typename Real>
CNERF_HD Vec3<Real> gamut_mapped_linear_rgb_from_lab(Lab<Real> lab);

}  // namespace cnerf
