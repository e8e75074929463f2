#pragma once
/// The 313 quantised ab colours of Zhang et al. 2016, soft labels over them, and ways back to one colour.

#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "src/base/host_device.h"
#include "src/color/colorspace_math.h"

namespace cnerf {

inline constexpr int kAbBinCount = 313;
inline constexpr float kAbGridStep = 10.0f;  ///< distance of neighbouring bins, in ab units

struct Ab {
  float a = 0, b = 0;
};
[[nodiscard]] inline Ab ab_of_linear_rgb(Vec3f rgb) {
  const Lab<float> lab = lab_from_linear_rgb(rgb);
  return {lab.a, lab.b};
}

/// Centres of the bins, ordered by a, then b.
[[nodiscard]] const std::array<Ab, kAbBinCount>& ab_bin_centres();

/// Five nearest bins with Gaussian weights that sum to 1 (paper, "soft-label operation S"; sigma as Zhang et al. 2016).
inline constexpr int kSoftLabelBins = 5;
inline constexpr float kSoftLabelSigma = 5.0f;
struct SoftLabel {
  std::array<int, kSoftLabelBins> bin{};
  std::array<float, kSoftLabelBins> weight{};
};
[[nodiscard]] SoftLabel soft_label(Ab color);
/// The weighted mean of a label's bins.  @param centres  [313] of the bins
[[nodiscard]] CNERF_HD inline Ab mean_of(const SoftLabel& label, const Ab* centres) {
  Ab mean;
  for (int i = 0; i < kSoftLabelBins; ++i) {
    const Ab centre = centres[label.bin[i]];
    mean.a += label.weight[i] * centre.a;
    mean.b += label.weight[i] * centre.b;
  }
  return mean;
}
[[nodiscard]] inline Ab mean_of(const SoftLabel& label) {
  return mean_of(label, ab_bin_centres().data());
}
/// Index of the nearest bin.
[[nodiscard]] int nearest_bin(Ab color);

/// Weight of a bin in the annealed mean, as an exponent: softmax(log p / temperature), up to a common factor.
template <typename Real>
[[nodiscard]] CNERF_HD Real annealed_exponent(Real logit, Real largest, Real temperature) {
  return (logit - largest) / temperature;
}
template <typename Real>
[[nodiscard]] CNERF_HD Real annealed_weight(Real logit, Real largest, Real temperature) {
  return std::exp(annealed_exponent(logit, largest, temperature));
}
/// Colour of the most probable bin, of several equally probable ones the first (paper, Eq. z to y).  @param logits
/// [313], any scale or offset.
[[nodiscard]] Ab decode_arg_max(std::span<const float> logits);
/// Mean of the centres under softmax(log p / temperature) (Zhang et al. 2016, Eq. 5). Temperature 1 is the mean,
/// towards 0 the mode. Within 1e-3 ab units.
[[nodiscard]] Ab decode_annealed_mean(std::span<const float> logits, float temperature);
/// exp(sum p ln p) of p = softmax(logits): one over the perplexity, the number of equally likely bins that is as
/// uncertain. From 1 / 313 to 1.  @param logits  [313], finite, any scale or offset.
[[nodiscard]] float inverse_perplexity(std::span<const float> logits);

/// Class rebalancing (Zhang et al. 2016, Sec. 2.2): w = 1 / ((1 - lambda) p + lambda / Q), scaled so that sum p w = 1.
/// @param prior  [313], sums to 1.
[[nodiscard]] std::vector<float> rebalancing_weights(std::span<const float> prior, float lambda);

}  // namespace cnerf
