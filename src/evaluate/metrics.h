#pragma once
/// Numbers that compare pictures. Free functions over plain arrays; nothing here knows a scene.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/evaluate/psnr.h"

namespace cnerf {

/// Structural similarity (Wang et al. 2004): 11x11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, mean over the
/// windows that lie inside the picture (and, where `valid` is given, whose centre is valid).
/// @param ours, truth  [H, W] encoded values of peak 1.
/// @return             nothing when no window fits.
[[nodiscard]] std::optional<double> ssim(std::span<const float> ours, std::span<const float> truth, int width,
                                         int height, std::span<const std::uint8_t> valid = {});

/// Colourfulness (Hasler and Suesstrunk 2003), from 8-bit sRGB values.
struct Colorfulness {
  double standard = 0;   ///< with signed rg and yb, as published
  double magnitude = 0;  ///< with |rg| and |yb|, as the code of CT2 and ColorNeRF computes it
};
/// @param rgb  [N, 3] 8-bit sRGB.
[[nodiscard]] Colorfulness colorfulness(std::span<const std::uint8_t> rgb, std::span<const std::uint8_t> valid = {});

/// Diversity of colours: how many equally frequent ones would be as diverse, exp(-Σ p_q ln p_q) with p_q the share of
/// pixels whose nearest of the 313 ab bins is q. 1 where all are of one bin, as in grey. It is Hill's number of order 1
/// (Hill, Ecology 54, 1973), the exponential of Shannon's entropy. Colourfulness grows with chroma; this with the
/// number of different colours, which averaging over unlike answers takes away.
/// @param rgb  [N, 3] linear Rec.709  @return  NaN where no pixel counts
[[nodiscard]] double color_diversity(std::span<const float> rgb, std::span<const std::uint8_t> valid = {});

/// Fréchet distance, squared, of the Gaussians that have the means and covariances of two sets of vectors (Dowson and
/// Landau, Journal of Multivariate Analysis 12, 1982):
///
///   d² = |m₁ - m₂|² + Tr(C₁ + C₂ - 2 (C₁ C₂)^½),
///
/// which is FID where the vectors are a network's features of pictures (Heusel et al. 2017). Covariances divide by one
/// less than there are vectors. No matrix of D x D is needed: with X and Y the centred vectors as rows, Tr (C₁ C₂)^½ is
/// the sum of the singular values of X Yᵀ over √((n - 1)(m - 1)).
/// @param a, b  [N, D] and [M, D], at least two each
[[nodiscard]] double frechet_distance(std::span<const float> a, std::span<const float> b, std::size_t dimensions);

/// Mean Euclidean distance of Lab a and b.
/// @param ours, truth  [N, 3] linear Rec.709; `truth` empty compares with grey, i.e. gives the mean chroma of `ours`.
[[nodiscard]] double mean_ab_distance(std::span<const float> ours, std::span<const float> truth,
                                      std::span<const std::uint8_t> valid = {});

/// sRGB-encoded values of linear light, clamped to [0, 1].
[[nodiscard]] std::vector<float> encoded(std::span<const float> linear);

}  // namespace cnerf
