#pragma once
/// The losses of stage 2 and their gradients, once for every device.
///
///   bins:   L = w (KL(label || softmax(logits)) + regression_weight R) + spread_weight S
///   field:  L = w |ab(composited XYZ) - target|, as Huber's loss or squared
///
/// Both are means over the pixels of a step.
///
/// w is the pixel's weight, R what it costs that the mean colour of its distribution is away from the label's, S the
/// spread of its samples' features.

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

/// p_q = softmax(logits)_q of one pixel.
struct Softmax {
  float largest = 0;  ///< logit
  float sum = 1;      ///< of the exponentials
  float log_sum = 0;

  Softmax() = default;
  CNERF_HD Softmax(float largest_logit, float sum_of_exponentials)
      : largest(largest_logit), sum(sum_of_exponentials), log_sum(std::log(sum_of_exponentials)) {}

  [[nodiscard]] CNERF_HD static float exponential(float logit, float largest) { return std::exp(logit - largest); }
  [[nodiscard]] CNERF_HD float probability(float exponential) const { return exponential / sum; }
  [[nodiscard]] CNERF_HD float log_probability(float logit) const { return logit - largest - log_sum; }
};

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
  const float distance = std::abs(d);
  return distance < kSmoothMean ? 0.5f * d * d / kSmoothMean : distance - 0.5f * kSmoothMean;
}
CNERF_HD inline float mean_slope(float d) {
  return d < -kSmoothMean ? -1.0f : d > kSmoothMean ? 1.0f : d / kSmoothMean;
}

/// The regression part of a pixel's loss, R.
struct MeanError {
  Ab mean;         ///< of the distribution
  Ab d_mean;       ///< derivative of regression_weight R by it
  float cost = 0;  ///< R

  MeanError() = default;
  /// @param wanted  the label's mean
  CNERF_HD MeanError(Ab of_distribution, Ab wanted, float regression_weight) : mean(of_distribution) {
    const Ab away = {mean.a - wanted.a, mean.b - wanted.b};
    d_mean = {regression_weight * mean_slope(away.a), regression_weight * mean_slope(away.b)};
    cost = mean_cost(away.a) + mean_cost(away.b);
  }
  /// Derivative of regression_weight R by a logit: d_mean . p_q (c_q - mean).
  [[nodiscard]] CNERF_HD float by_logit(float probability, Ab centre) const {
    return probability * (d_mean.a * (centre.a - mean.a) + d_mean.b * (centre.b - mean.b));
  }
};

/// Derivative of `scale` times a pixel's loss by a logit: scale (p_q + dR/dlogit_q - z_q), in two parts, for a label
/// has few bins.
CNERF_HD inline float logit_gradient(float probability, float by_regression, float scale) {
  return (probability + by_regression) * scale;
}
/// @param label  z_q
CNERF_HD inline float label_gradient(float label, float scale) {
  return -scale * label;
}

/// What an ab distance of d costs.
enum class AbLoss {
  kHuber,    ///< d^2 below a few units, d above: a few wrong pixels hardly count
  kSquared,  ///< d^2, the photometric loss: its minimum is the mean of the targets
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
