#pragma once
/// The maths of the paper's own field as LibTorch operations, differentiable and for any floating point type:
/// positional encoding, importance sampling and compositing of Mildenhall et al. 2020, and this program's activations
/// and loss.

#include <torch/torch.h>

#include <numbers>

namespace cnerf::compare::positional {

/// x and the sines and cosines of 2^k pi x for k in 0 .. L - 1 (Mildenhall et al. 2020, Eq. 4; x itself as in their
/// published code).
/// @param x            [N, C], within [-1, 1]
/// @param frequencies  L
/// @return             [N, C (1 + 2 L)]
inline torch::Tensor encoding(const torch::Tensor& x, int frequencies) {
  const torch::Tensor octaves =
      std::numbers::pi * torch::pow(2.0, torch::arange(frequencies, x.options()));  // in the type of x
  const torch::Tensor angles = (x.unsqueeze(-1) * octaves).flatten(1);              // [N, C L]
  return torch::cat({x, angles.sin(), angles.cos()}, 1);
}

/// w_i = T_i (1 - exp(-sigma_i dt_i)) (paper, Eq. vol rendering), as the engines composite.
/// @param sigma, dt  [R, S], front to back
/// @return           [R, S]; a ray's sum is its opacity
inline torch::Tensor weights(const torch::Tensor& sigma, const torch::Tensor& dt) {
  const torch::Tensor thickness = sigma * dt;
  const torch::Tensor behind = thickness.cumsum(1);
  return torch::exp(thickness - behind) * -torch::expm1(-thickness);  // exp(-(what lies before)) alpha
}

/// Where the distribution function of a density that is constant between edges reaches u (Mildenhall et al. 2020,
/// Sec. 5.2): "inverse transform sampling". Not differentiated through.
/// @param edges    [R, B + 1], rising
/// @param weights  [R, B], >= 0; a little is added, so that no part of a ray is left out for good
/// @param u        [R, M], within [0, 1]
/// @return         [R, M]
inline torch::Tensor inverse_transform(const torch::Tensor& edges, const torch::Tensor& weights,
                                       const torch::Tensor& u) {
  const torch::NoGradGuard no_gradient;
  const torch::Tensor padded = weights + 1e-5;
  const torch::Tensor share = padded / padded.sum(1, /*keepdim=*/true);
  const torch::Tensor cdf = torch::cat({torch::zeros_like(share.slice(1, 0, 1)), share.cumsum(1)}, 1);
  const std::int64_t bins = weights.size(1);
  const torch::Tensor bin =
      (torch::searchsorted(cdf, u.contiguous(), /*out_int32=*/false, /*right=*/true) - 1).clamp(0, bins - 1);
  const torch::Tensor below = cdf.gather(1, bin), left = edges.gather(1, bin), right = edges.gather(1, bin + 1);
  return left + ((u - below) / share.gather(1, bin)).clamp(0, 1) * (right - left);
}

/// L* of linear luminance (CIE 1976), as src/color/colorspace_math.h has it.
inline torch::Tensor lightness(const torch::Tensor& luminance) {
  constexpr double kEpsilon = 216.0 / 24389.0, kKappa = 24389.0 / 27.0;
  // Both branches are computed, so the root must not see what it has no finite derivative at.
  return torch::where(luminance > kEpsilon, 116.0 * luminance.clamp_min(kEpsilon).pow(1.0 / 3.0) - 16.0,
                      kKappa * luminance);
}
inline torch::Tensor luminance_of(const torch::Tensor& lightness) {
  return torch::where(lightness > 8.0, ((lightness + 16.0) / 116.0).pow(3), lightness * (27.0 / 24389.0));
}
/// Linear luminance of a net's raw output; see LuminanceActivation.
inline torch::Tensor emitted_luminance(const torch::Tensor& raw, double brightest_lightness) {
  return luminance_of(brightest_lightness * torch::sigmoid(raw));
}
/// Density, 1/unit length, of a net's raw output; see density_from_raw.
inline torch::Tensor density(const torch::Tensor& raw, double scale) {
  return raw.clamp(-15.0, 15.0).exp() * scale;
}

/// Mean over pixels of weight times KL(label || softmax(logits)) (paper, Eq. color classification loss).
/// @param logits  [R, Q]   @param bins [R, 5], i64, with the shares [R, 5] of the label   @param pixel_weights  [R]
inline torch::Tensor classification_loss(const torch::Tensor& logits, const torch::Tensor& bins,
                                         const torch::Tensor& shares, const torch::Tensor& pixel_weights) {
  const torch::Tensor surprise = shares.clamp_min(1e-30).log() - torch::log_softmax(logits, 1).gather(1, bins);
  return ((shares * surprise).sum(1) * pixel_weights).mean();
}

}  // namespace cnerf::compare::positional
