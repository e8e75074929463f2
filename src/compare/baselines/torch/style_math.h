#pragma once
/// The maths of style transfer as differentiable LibTorch operations.

#include <torch/torch.h>

namespace cnerf::compare::style {

/// sRGB of L*, a*, b*, clamped to the gamut, as src/color/colorspace_math.h converts.
/// @param lightness  [H, W]   @param ab  [2, H, W]   @return  [1, 3, H, W] in 0..1
inline torch::Tensor srgb(const torch::Tensor& lightness, const torch::Tensor& ab) {
  constexpr double kEpsilon = 216.0 / 24389.0, kKappa = 24389.0 / 27.0;
  const auto f_inverse = [&](const torch::Tensor& f) {
    const torch::Tensor cube = f.pow(3);
    return torch::where(cube > kEpsilon, cube, (116.0 * f - 16.0) / kKappa);
  };
  const torch::Tensor fy = (lightness + 16.0) / 116.0;
  const torch::Tensor y = f_inverse(fy);
  const torch::Tensor x = f_inverse(fy + ab[0] / 500.0) - y, z = f_inverse(fy - ab[1] / 200.0) - y;
  const torch::Tensor linear = torch::stack({y + 3.079954467464594003 * x - 0.542815954666877154 * z,
                                             y - 0.921258284014264905 * x + 0.045247438567570818 * z,
                                             y + 0.052887411823709742 * x + 1.151138501693044214 * z})
                                   .clamp(0, 1);
  const torch::Tensor power = 1.055 * linear.clamp_min(0.0031308).pow(1.0 / 2.4) - 0.055;
  return torch::where(linear > 0.0031308, power, 12.92 * linear).unsqueeze(0);
}

/// Feature vectors of unit length.  @param features  [1, C, H, W]  @return  [H W, C]
inline torch::Tensor unit_vectors(const torch::Tensor& features) {
  const torch::Tensor vectors = features.flatten(2)[0].t();
  return vectors / (vectors.norm(2, 1, /*keepdim=*/true) + 1e-8);
}

/// Mean of 1 - cosine to the nearest vector of the reference (ARF, Eq. 1).
/// @param ours, reference  [N, C] and [M, C] of unit length; differentiable in `ours`
inline torch::Tensor nearest_neighbour_loss(const torch::Tensor& ours, const torch::Tensor& reference) {
  constexpr std::int64_t kAtATime = 1024;  // rows of similarities in memory
  std::vector<torch::Tensor> nearest;
  {
    const torch::NoGradGuard no_gradient;  // the choice has no derivative
    for (const torch::Tensor& part : ours.split(kAtATime)) nearest.push_back(part.matmul(reference.t()).argmax(1));
  }
  return 1 - (ours * reference.index_select(0, torch::cat(nearest))).sum(1).mean();
}

}  // namespace cnerf::compare::style
