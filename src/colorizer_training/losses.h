#pragma once
/// What training minimises: soft-encoded classification of ab, a small regression term, labels and features.

#include <torch/torch.h>

#include <vector>

#include "src/colorizer_training/image_set.h"

namespace cnerf::colorizer_training {

/// Soft labels of ab colours by table: one entry a unit of ab, which is a tenth of a bin.
class SoftLabelTable {
 public:
  explicit SoftLabelTable(torch::Device device);

  struct Targets {
    torch::Tensor bin;     ///< [P, 5] i64; the first is the nearest
    torch::Tensor weight;  ///< [P, 5] f32, sums to 1
  };
  /// @param ab  [B, 2, h, w].  @return  for the P = B h w colours, row by row.
  [[nodiscard]] Targets look_up(const torch::Tensor& ab) const;
  [[nodiscard]] torch::Device device() const { return centres_.device(); }
  /// [313, 2] f32.
  [[nodiscard]] const torch::Tensor& centres() const { return centres_; }

 private:
  torch::Tensor bin_, weight_;  ///< [cells of the table, 5]
  torch::Tensor centres_;
};

/// Soft-encoded share of every bin among the images, smoothed as in Zhang et al. 2016. [313] f32 on the CPU, sums to 1.
[[nodiscard]] torch::Tensor measure_prior(const std::vector<torch::Tensor>& ab_samples, const SoftLabelTable& table);

struct ColorLoss {
  torch::Tensor classification;  ///< KL up to the targets' entropy, rebalanced
  torch::Tensor regression;      ///< smooth L1 (beta 10) of the expected ab
};
/// @param logits  [B, 313, h, w].  @param class_weights [313].
[[nodiscard]] ColorLoss color_loss(const torch::Tensor& logits, const torch::Tensor& ab, const SoftLabelTable& table,
                                   const torch::Tensor& class_weights);

/// What networks make of a picture, learned by another (Hinton et al. 2015): KL(taught || learned) up to the taught
/// distribution's entropy, mean over the blocks. Taught is the mean of the networks' distributions.
/// @param logits         [B, 313, h, w].
/// @param taught_logits  [B, 313, h, w] of the same pictures, of one network or more.
[[nodiscard]] torch::Tensor distillation_loss(const torch::Tensor& logits,
                                              const std::vector<torch::Tensor>& taught_logits);

/// Heads that only training has: the class of the picture, and a frozen classifier's features of its colours.
class AuxiliaryHeadsImpl : public torch::nn::Module {
 public:
  AuxiliaryHeadsImpl(std::int64_t classes, std::int64_t feature_channels);
  torch::Tensor classify(const torch::Tensor& global);            ///< [B, 256] -> [B, classes]
  torch::Tensor predict_features(const torch::Tensor& semantic);  ///< [B, C, h, w] -> [B, F, h, w]

 private:
  torch::nn::Linear hidden_{nullptr}, label_{nullptr};
  torch::nn::Dropout dropout_{nullptr};
  torch::nn::Conv2d features_{nullptr};
};
TORCH_MODULE(AuxiliaryHeads);

/// Cross-entropy within the label's own set, over the labelled images; 0 when there is none.
class LabelLoss {
 public:
  LabelLoss(const ClassList& classes, torch::Device device);
  [[nodiscard]] torch::Tensor operator()(const torch::Tensor& logits, const std::vector<int>& labels) const;

 private:
  const ClassList& classes_;
  torch::Tensor other_sets_;  ///< [sets + 1, classes] 0 inside the set, very negative elsewhere
};

/// 1 - cosine between standardised teacher features and their prediction, both [B, F, h, w].
[[nodiscard]] torch::Tensor feature_loss(const torch::Tensor& predicted, const torch::Tensor& teacher);

}  // namespace cnerf::colorizer_training
