#pragma once
/// From the network's quarter-resolution logits to full-resolution ab.

#include <torch/torch.h>

#include "src/colorizer/network.h"

namespace cnerf {

/// How a distribution over the bins becomes one colour. Chosen once, on validation images, and stored with the weights.
struct AbDecoding {
  double temperature = 1;  ///< annealed mean: softmax(logits / temperature); 1 is the mean
  double gain = 1;         ///< factor on the mean's chroma
};

/// Bin centres. [313, 2] f32 on `device`.
[[nodiscard]] torch::Tensor ab_centres_tensor(torch::Device device);

/// @param logits  [B, 313, h, w].
/// @return        [B, 2, h, w] f32 ab.
[[nodiscard]] torch::Tensor decode_ab(const torch::Tensor& logits, const AbDecoding& decoding);

/// Brings quarter-resolution features to full resolution. A pixel averages the 3x3 blocks around it, by distance and by
/// how close their mean lightness is to its own (joint bilateral upsampling, Kopf et al. 2007): colours stop at edges.
/// @param blocks     [B, C, ceil(H/4), ceil(W/4)].
/// @param lightness  [B, 1, H, W] L* 0..100.
/// @return           [B, C, H, W], convex combinations of `blocks`.
[[nodiscard]] torch::Tensor guided_upsample(const torch::Tensor& blocks, const torch::Tensor& lightness);

/// Logits of the picture, averaged with those of its mirror image.  [B, 313, ceil(H/4), ceil(W/4)]
[[nodiscard]] torch::Tensor logits_with_flips(ColorizerNet& network, const torch::Tensor& lightness);

/// The whole way: network, mean of the logits of the picture and its mirror image, decoding, guided upsampling.
/// @param lightness  [B, 1, H, W] f32, L* 0..100, on the network's device.
/// @return           [B, 2, H, W] f32 ab.
[[nodiscard]] torch::Tensor colorize_with_flips(ColorizerNet& network, const torch::Tensor& lightness,
                                                const AbDecoding& decoding);

}  // namespace cnerf
