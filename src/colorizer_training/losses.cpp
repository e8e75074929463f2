#include "src/colorizer_training/losses.h"

#include "src/base/check.h"
#include "src/color/ab_bins.h"
#include "src/colorizer/torch/network.h"
#include "src/colorizer/torch/network_decode.h"
#include "src/colorizer_training/batch.h"

namespace cnerf::colorizer_training {
namespace nn = torch::nn;
namespace F = torch::nn::functional;
using torch::Tensor;

namespace {

constexpr int kTableLimit = 110;  // the sRGB gamut lies inside +-108
constexpr int kTableSide = 2 * kTableLimit + 1;
constexpr double kRegressionBeta = 10;
constexpr double kLabelSmoothing = 0.1;
constexpr float kExcluded = -1e9f;
constexpr double kPriorSmoothing = 5;  // ab units, as the soft labels

/// [B, 313, h, w] -> [B h w, 313].
Tensor log_probability_rows(const Tensor& logits) {
  return torch::log_softmax(logits.permute({0, 2, 3, 1}).reshape({-1, kAbBinCount}).to(torch::kFloat32), 1);
}

}  // namespace

SoftLabelTable::SoftLabelTable(torch::Device device) {
  std::vector<std::int64_t> bins;
  std::vector<float> weights;
  for (int a = -kTableLimit; a <= kTableLimit; ++a) {
    for (int b = -kTableLimit; b <= kTableLimit; ++b) {
      const SoftLabel label = soft_label({float(a), float(b)});
      bins.insert(bins.end(), label.bin.begin(), label.bin.end());
      weights.insert(weights.end(), label.weight.begin(), label.weight.end());
    }
  }
  centres_ = ab_centres_tensor(device);
  bin_ = torch::tensor(bins).view({-1, kSoftLabelBins}).to(device);
  weight_ = torch::tensor(weights).view({-1, kSoftLabelBins}).to(device);
}

SoftLabelTable::Targets SoftLabelTable::look_up(const Tensor& ab) const {
  const Tensor cell = (ab.round().clamp(-kTableLimit, kTableLimit) + kTableLimit).to(torch::kInt64);
  const Tensor index = (cell.select(1, 0) * kTableSide + cell.select(1, 1)).flatten();
  return {bin_.index_select(0, index), weight_.index_select(0, index)};
}

Tensor measure_prior(const std::vector<Tensor>& ab_samples, const SoftLabelTable& table) {
  Tensor prior = torch::zeros({kAbBinCount}, torch::kFloat64);
  for (const Tensor& ab : ab_samples) {
    const auto targets = table.look_up(ab);
    const Tensor bins = targets.bin.flatten().cpu(), weights = targets.weight.flatten().cpu().to(torch::kFloat64);
    prior.index_add_(0, bins, weights);
  }
  prior = prior / prior.sum();
  const Tensor centres = ab_centres_tensor(torch::kCPU).to(torch::kFloat64);
  const Tensor distance = torch::cdist(centres, centres);
  Tensor kernel = torch::exp(-distance.square() / (2 * kPriorSmoothing * kPriorSmoothing));
  kernel = kernel / kernel.sum(0, true);
  prior = torch::matmul(kernel, prior);
  return (prior / prior.sum()).to(torch::kFloat32);
}

ColorLoss color_loss(const Tensor& logits, const Tensor& ab, const SoftLabelTable& table, const Tensor& class_weights) {
  const auto targets = table.look_up(ab);
  const Tensor log_probability = log_probability_rows(logits);
  const Tensor cross_entropy = -(log_probability.gather(1, targets.bin) * targets.weight).sum(1);
  const Tensor weight = class_weights.index_select(0, targets.bin.select(1, 0));
  const Tensor expected = torch::matmul(log_probability.exp(), table.centres());  // [P, 2]
  const Tensor truth = ab.permute({0, 2, 3, 1}).reshape({-1, 2});
  const Tensor regression = 2 * torch::smooth_l1_loss(expected, truth, at::Reduction::Mean, kRegressionBeta);
  return {(cross_entropy * weight).mean(), regression};
}

Tensor distillation_loss(const Tensor& logits, const std::vector<Tensor>& taught_logits) {
  CNERF_CHECK(!taught_logits.empty(), "there is a network to learn from");
  Tensor taught = log_probability_rows(taught_logits[0]).exp();
  for (std::size_t i = 1; i < taught_logits.size(); ++i) taught += log_probability_rows(taught_logits[i]).exp();
  return -(taught * log_probability_rows(logits)).sum(1).mean() / double(taught_logits.size());
}

AuxiliaryHeadsImpl::AuxiliaryHeadsImpl(std::int64_t classes, std::int64_t feature_channels) {
  constexpr std::int64_t kHidden = 512;
  hidden_ = register_module("hidden", nn::Linear(ColorizerNetImpl::kGlobalChannels, kHidden));
  dropout_ = register_module("dropout", nn::Dropout(0.2));
  label_ = register_module("label", nn::Linear(kHidden, std::max<std::int64_t>(classes, 1)));
  features_ = register_module("features",
                              nn::Conv2d(nn::Conv2dOptions(ColorizerNetImpl::kSemanticChannels, feature_channels, 1)));
}

Tensor AuxiliaryHeadsImpl::classify(const Tensor& global) {
  return label_->forward(dropout_->forward(torch::relu(hidden_->forward(global))));
}

Tensor AuxiliaryHeadsImpl::predict_features(const Tensor& semantic) {
  return features_->forward(semantic);
}

LabelLoss::LabelLoss(const ClassList& classes, torch::Device device) : classes_(classes) {
  const auto sets = std::int64_t(classes.set_ranges.size());
  Tensor mask = torch::full({sets + 1, std::max<std::int64_t>(1, std::int64_t(classes.names.size()))}, kExcluded);
  for (std::int64_t set = 0; set < sets; ++set) {
    const auto [first, last] = classes.set_ranges[std::size_t(set)];
    mask[set].slice(0, first, last).zero_();
  }
  mask[sets].zero_();  // unlabelled images: any value, their loss is multiplied by 0
  other_sets_ = mask.to(device);
}

Tensor LabelLoss::operator()(const Tensor& logits, const std::vector<int>& labels) const {
  std::vector<std::int64_t> target, set;
  std::vector<float> known;
  for (const int label : labels) {
    const int range = classes_.range_of(label);
    known.push_back(range >= 0);
    set.push_back(range >= 0 ? range : std::int64_t(classes_.set_ranges.size()));
    target.push_back(std::max(label, 0));
  }
  const torch::Device device = logits.device();
  const Tensor mask = other_sets_.index_select(0, upload(torch::tensor(set), device));
  const Tensor log_probability = torch::log_softmax(logits.to(torch::kFloat32) + mask, 1);
  const Tensor picked = log_probability.gather(1, upload(torch::tensor(target), device).unsqueeze(1)).squeeze(1);
  const Tensor inside = (mask == 0).to(torch::kFloat32);
  const Tensor mean = (log_probability * inside).sum(1) / inside.sum(1);
  const Tensor loss = -((1 - kLabelSmoothing) * picked + kLabelSmoothing * mean);
  const Tensor known_rows = upload(torch::tensor(known), device);
  return (loss * known_rows).sum() / known_rows.sum().clamp_min(1);
}

Tensor feature_loss(const Tensor& predicted, const Tensor& teacher) {
  const Tensor mean = teacher.mean({0, 2, 3}, true);
  const Tensor deviation = (teacher - mean).square().mean({0, 2, 3}, true).sqrt() + 1e-3;
  return 1 - F::cosine_similarity(predicted.to(torch::kFloat32), (teacher - mean) / deviation,
                                  F::CosineSimilarityFuncOptions().dim(1))
                 .mean();
}

}  // namespace cnerf::colorizer_training
