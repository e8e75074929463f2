#pragma once
/// sRGB, linear Rec.709, XYZ and CIE 1976 L*a*b* (D65, 2 degrees). Own conversions, because a monochrome project needs
/// grey to give a = b = 0 exactly: tristimulus is relative to white, so each matrix row sums to 1, and rows are applied
/// to channel differences, which a grey does not have.

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
  // Both are computed, so that many of them become vector instructions.
  const Real cube = f * f * f, line = (Real(116) * f - Real(16)) / LabConstants<Real>::kappa;
  return cube > LabConstants<Real>::epsilon ? cube : line;
}
/// The derivative of `lab_f_inverse`.
template <typename Real>
CNERF_HD Real lab_f_inverse_derivative(Real f) {
  const Real square = f * f;
  return square * f > LabConstants<Real>::epsilon ? Real(3) * square : Real(116) / LabConstants<Real>::kappa;
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
/// d Y / d L*.
template <typename Real>
CNERF_HD Real luminance_derivative(Real lightness) {
  return lab_f_inverse_derivative((lightness + Real(16)) / Real(116)) / Real(116);
}

/// Rec.709 luma coefficients of linear light: the Y row of the RGB -> XYZ matrix. Like all rows here it sums to 1 and
/// is applied to differences from one channel, so that a grey returns its own value, bit for bit, in any precision.
template <typename Real>
CNERF_HD Real luminance_of(Vec3<Real> rgb) {
  return rgb.y + Real(0.212672851405622476) * (rgb.x - rgb.y) + Real(0.072174993306559576) * (rgb.z - rgb.y);
}

/// XYZ relative to white, (X/Xn, Y, Z/Zn), of linear Rec.709; a grey maps to three equal numbers.
/// From the primaries (0.64, 0.33), (0.30, 0.60), (0.15, 0.06) and the D65 white (0.95047, 1, 1.08883).
template <typename Real>
CNERF_HD Vec3<Real> relative_xyz_from_linear_rgb(Vec3<Real> rgb) {
  const Real red = rgb.x - rgb.y;
  const Real blue = rgb.z - rgb.y;
  return {rgb.y + Real(0.433949981682422492) * red + Real(0.189840271935357158) * blue, luminance_of(rgb),
          rgb.y + Real(0.017756578696701338) * red + Real(0.872775436511087799) * blue};
}
/// Inverse of `relative_xyz_from_linear_rgb`.
template <typename Real>
CNERF_HD Vec3<Real> linear_rgb_from_relative_xyz(Vec3<Real> xyz) {
  const Real x = xyz.x - xyz.y;
  const Real z = xyz.z - xyz.y;
  return {xyz.y + Real(3.079954467464594003) * x - Real(0.542815954666877154) * z,
          xyz.y - Real(0.921258284014264905) * x + Real(0.045247438567570818) * z,
          xyz.y + Real(0.052887411823709742) * x + Real(1.151138501693044214) * z};
}

template <typename Real>
struct Lab {
  Real lightness{}, a{}, b{};  ///< L* 0..100; a, b about -110..110
};

template <typename Real>
CNERF_HD Lab<Real> lab_from_linear_rgb(Vec3<Real> rgb) {
  const Vec3<Real> xyz = relative_xyz_from_linear_rgb(rgb);
  const Real fy = lab_f(xyz.y);
  return {Real(116) * fy - Real(16), Real(500) * (lab_f(xyz.x) - fy), Real(200) * (fy - lab_f(xyz.z))};
}
/// May leave the gamut: components below 0 or above 1.
template <typename Real>
CNERF_HD inline Vec3<Real> linear_rgb_from_lab(Lab<Real> lab) {
  const Real fy = (lab.lightness + Real(16)) / Real(116);
  return linear_rgb_from_relative_xyz<Real>(
      {lab_f_inverse(fy + lab.a / Real(500)), lab_f_inverse(fy), lab_f_inverse(fy - lab.b / Real(200))});
}

/// Like `linear_rgb_from_lab`, but chroma is scaled down at constant lightness and hue until every component is in
/// [0, max(1, Y)]; channels are never clipped (that would change the hue). A lightness below 0 counts as 0.
/// @param steps  that halve what is unknown of the scale; as many as a chroma of 128 needs in this precision
template <typename Real>
CNERF_HD Vec3<Real> gamut_mapped_linear_rgb_from_lab(Lab<Real> lab, int steps = sizeof(Real) == 4 ? 22 : 50) {
  lab.lightness = lab.lightness > Real(0) ? lab.lightness : Real(0);
  if (lab.a == Real(0) && lab.b == Real(0)) {
    const Real grey = luminance_from_lightness(lab.lightness);
    return {grey, grey, grey};
  }
  const auto with_chroma = [&](Real scale) {
    return linear_rgb_from_lab<Real>({lab.lightness, lab.a * scale, lab.b * scale});
  };
  const Vec3<Real> grey = with_chroma(Real(0));
  const Real limit = grey.y > Real(1) ? grey.y : Real(1);
  const auto in_gamut = [&](Vec3<Real> c) {
    return c.x >= Real(0) && c.y >= Real(0) && c.z >= Real(0) && c.x <= limit && c.y <= limit && c.z <= limit;
  };
  const Vec3<Real> wanted = with_chroma(Real(1));
  if (in_gamut(wanted)) return wanted;
  // Bisection keeps `inside` in gamut.
  Vec3<Real> inside = grey;
  Real low = 0;
  Real high = 1;
  for (int step = 0; step < steps; ++step) {
    const Real middle = (low + high) / Real(2);
    const Vec3<Real> color = with_chroma(middle);
    if (in_gamut(color)) {
      inside = color;
      low = middle;
    } else {
      high = middle;
    }
  }
  return inside;
}

}  // namespace cnerf
