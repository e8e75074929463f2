#pragma once
/// The maths of stage 2's engines, once for every device.

#include <cmath>

#include "src/base/host_device.h"
#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"

namespace cnerf {

/// Pixels of less opacity have no colour: a uniform softmax would decode to the first bin, a vivid green.
inline constexpr float kLeastColoredOpacity = 0.01f;

/// 1 / A, or 0 for pixels that have no colour.
CNERF_HD inline float inverse_opacity(float opacity) {
  return opacity < kLeastColoredOpacity ? 0.0f : 1.0f / opacity;
}

/// A bin's part of KL(label || p).  @param label  > 0
CNERF_HD inline float divergence(float label, float log_probability) {
  return label * (std::log(label) - log_probability);
}

/// The spread of a pixel with samples of features h_i and shares w_i / A, composited to H, is
///   sum_i w_i / A |h_i - H|^2 = sum_i w_i / A |h_i|^2 - |H|^2.
/// Weighed into the loss it gives a surface one colour through its depth, so that views which weigh its samples
/// otherwise show the same colour. H being the mean, its own derivative falls out:
/// @return  s of the derivative by h_i: s w_i / A (h_i - H)   @param scale  of the loss
CNERF_HD inline float spread_slope(float spread_weight, float scale) {
  return 2 * spread_weight * scale;
}

/// The mean colour of a distribution p over the bins, and what it costs to be away from the label's by d: smooth L1 in
/// a and in b, quadratic below a few units. The colorizer's training has the same term (colorizer_training/losses.h).
inline constexpr float kSmoothMean = 10.0f;
CNERF_HD inline float mean_cost(float d) {
  const float far = std::abs(d);
  return far < kSmoothMean ? 0.5f * d * d / kSmoothMean : far - 0.5f * kSmoothMean;
}
CNERF_HD inline float mean_slope(float d) {
  return d < -kSmoothMean ? -1.0f : d > kSmoothMean ? 1.0f : d / kSmoothMean;
}
/// Derivative of a function of the mean by a logit: dL/dmean . (p_q (c_q - mean)).
/// @param d_mean  dL/dmean
CNERF_HD inline float logit_slope(float probability, Ab centre, Ab mean, Ab d_mean) {
  return probability * (d_mean.a * (centre.a - mean.a) + d_mean.b * (centre.b - mean.b));
}

/// What an ab distance of d costs.
enum class AbLoss {
  kHuber,    ///< d^2 below a few units, d above: what a few wrong pixels say hardly counts
  kSquared,  ///< d^2, the photometric loss: the mean of what is said
};

inline constexpr float kLogRatioLimit = 3.0f;   ///< chromaticity stays within e^-3 .. e^3: far beyond Rec.709
inline constexpr float kSmoothDistance = 4.0f;  ///< ab units below which Huber's loss is quadratic

/// Chromaticity of a sample from the net's output.
CNERF_HD inline float ratio_of(float log_ratio) {
  return std::exp(log_ratio < -kLogRatioLimit  ? -kLogRatioLimit
                  : log_ratio > kLogRatioLimit ? kLogRatioLimit
                                               : log_ratio);
}
CNERF_HD inline float ratio_derivative(float log_ratio) {
  return std::abs(log_ratio) < kLogRatioLimit ? ratio_of(log_ratio) : 0.0f;
}

/// XYZ of a pixel relative to white.
struct PixelXyz {
  float x = 0, y = 0, z = 0;
};
CNERF_HD inline Ab ab_of(const PixelXyz& pixel) {
  return {500.0f * (lab_f(pixel.x) - lab_f(pixel.y)), 200.0f * (lab_f(pixel.y) - lab_f(pixel.z))};
}

/// How far a pixel is from its target, in ab units, and the gradient of `scale` times its loss.
struct AbError {
  float distance = 0, d_x = 0, d_z = 0;
};
CNERF_HD inline AbError ab_error(const PixelXyz& seen, Ab target, AbLoss loss, float scale) {
  const Ab color = ab_of(seen);
  const float da = color.a - target.a, db = color.b - target.b;
  const float distance = std::sqrt(da * da + db * db);
  const bool is_far = loss == AbLoss::kHuber && distance > kSmoothDistance;
  const float slope = scale / (is_far ? distance : kSmoothDistance);
  return {distance, slope * da * 500.0f * lab_f_derivative(seen.x), -slope * db * 200.0f * lab_f_derivative(seen.z)};
}

}  // namespace cnerf
