#pragma once
/// Lab and sRGB of whole pictures, on any device.

#include <torch/torch.h>

namespace cnerf {

/// Lab of sRGB in 0..1: L* [B, 1, H, W] and ab [B, 2, H, W], by the project's own matrix (grey gives a = b = 0).
struct LabPlanes {
  torch::Tensor lightness, ab;
};
[[nodiscard]] LabPlanes lab_from_srgb(const torch::Tensor& srgb);
/// sRGB 0..1 of Lab planes [B, 1, H, W], [B, 2, H, W], clamped to the gamut by channel.  [B, 3, H, W]
[[nodiscard]] torch::Tensor srgb_from_lab(const torch::Tensor& lightness, const torch::Tensor& ab);
/// The value that all channels of a grey have. Of any shape, not clamped.
[[nodiscard]] torch::Tensor srgb_from_lightness(const torch::Tensor& lightness);

}  // namespace cnerf
