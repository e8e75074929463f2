#pragma once
/// How good colours are, in the measures colorizers are compared by (Zhang et al. 2016, Hasler and Suesstrunk 2003).

#include <torch/torch.h>

#include <string>
#include <vector>

#include "src/colorizer/torch/network_decode.h"
#include "src/colorizer_training/image_set.h"
#include "src/colorizer_training/losses.h"

namespace cnerf::colorizer_training {

struct ChromaScore {
  double raw_auc = 0;       ///< percent: share of pixels with ab error under a threshold, averaged over 0..150
  double balanced_auc = 0;  ///< the same, every bin of the ground truth counting the same
  double rmse = 0;          ///< root of the mean square over pixels and the two channels
  double colorfulness = 0;  ///< mean over the images, of the answer
  double true_colorfulness = 0;
};

/// What an answer of one colour everywhere scores: no colour, and the best colour for each measure by itself.
struct Baselines {
  ChromaScore grey, best_constant;
};

struct SetScore {
  std::string name;
  int images = 0;
  ChromaScore network;
  Baselines baselines;
};

/// A way to ask and read the network: what is added to its logits besides.
struct DecodingChoice {
  double prior_share = 0;  ///< of the rebalancing that is taken back: logits - share * log w
  AbDecoding decoding;
};

/// Scores all `choices` in one pass over the images, on the table's device.
/// @param log_weights  [313] log of the rebalancing weights used in training; empty where every prior_share is 0.
[[nodiscard]] std::vector<ChromaScore> score_network(ColorizerNet& network, const std::vector<Picture>& images,
                                                     const std::vector<DecodingChoice>& choices,
                                                     const torch::Tensor& log_weights, const SoftLabelTable& table);
[[nodiscard]] Baselines score_baselines(const std::vector<Picture>& images, const SoftLabelTable& table);

/// One number to choose by: points of balanced AuC above grey's, less one point for every 0.01 of grey's RMSE above
/// 0.82 and two for every point of raw AuC that is missing at +1.5. Laxer limits (0.85, +0.3) chose colours that put
/// rainbows on white walls.
[[nodiscard]] double merit(const ChromaScore& network, const ChromaScore& grey);

/// The table of the model card (Markdown).
[[nodiscard]] std::string score_table(const std::vector<SetScore>& sets);

}  // namespace cnerf::colorizer_training
