#pragma once
/// From lightness to ab: the picture is brought to the size the network knows, asked, and the answer brought back.

#include <torch/torch.h>

#include "src/colorizer/torch/network.h"

namespace cnerf {

/// How the network is asked, and how its distribution over the bins becomes one colour. Chosen once, on validation
/// images, and stored with the weights.
struct AbDecoding {
  double temperature = 1;  ///< annealed mean: softmax(logits / temperature); 1 is the mean
  double gain = 1;         ///< factor on the mean's chroma
  int short_side = 256;    ///< of the picture as the network sees it, pixels: the size of things in its training crops
};

/// Bin centres. [313, 2] f32 on `device`.
[[nodiscard]] torch::Tensor ab_centres_tensor(torch::Device device);

/// @param logits  [B, 313, h, w].
/// @return        [B, 2, h, w] f32 ab.
[[nodiscard]] torch::Tensor decode_ab(const torch::Tensor& logits, const AbDecoding& decoding);

/// @param logits  [B, bins, h, w], of any number of bins.
/// @return        [B, 1, h, w] f32, exp(sum p ln p) of p = softmax(logits): `certainty_of` in colorizer.h.
[[nodiscard]] torch::Tensor certainty_map(const torch::Tensor& logits);

/// Brings features on a coarse grid over the picture to its pixels. A pixel averages the 3x3 cells around it, by
/// distance and by how close their mean lightness is to its own (joint bilateral upsampling, Kopf et al. 2007): colours
/// stop at edges.
/// @param cells      [B, C, h, w], any grid; its cells share the picture's area equally.
/// @param lightness  [B, 1, H, W] L* 0..100.
/// @return           [B, C, H, W], convex combinations of `cells`.
[[nodiscard]] torch::Tensor guided_upsample(const torch::Tensor& cells, const torch::Tensor& lightness);

/// Asks the network about the picture resampled to `short_side`, each side rounded to the network's multiple:
/// stretching a picture by a few percent costs less than padding it does. A picture longer than 8:1 is brought to 8
/// short sides.
/// @param lightness  [B, 1, H, W] f32, L* 0..100, any size, on the network's device.
/// @return           [B, 313, h, w] logits; h and w are a quarter of the sides asked at.
[[nodiscard]] torch::Tensor ask_network(ColorizerNet& network, const torch::Tensor& lightness, int short_side);

/// The answer's way back: decoding, then guided upsampling to the picture's own size.
/// @param logits  [B, 313, h, w], of `ask_network`.
/// @return        [B, 2, H, W] f32 ab.
[[nodiscard]] torch::Tensor read_answer(const torch::Tensor& logits, const torch::Tensor& lightness,
                                        const AbDecoding& decoding);

/// The whole way: `ask_network`, `read_answer`.
[[nodiscard]] torch::Tensor colorize_lightness(ColorizerNet& network, const torch::Tensor& lightness,
                                               const AbDecoding& decoding);

}  // namespace cnerf
