#include "src/colorizer_training/ensemble.h"

#include "src/color/ab_bins.h"
#include "src/colorizer/torch/network_weights.h"

namespace cnerf {
namespace fs = std::filesystem;
using torch::Tensor;

namespace {

/// Mixed precision would convert every weight anew at each step, and convolutions want channels last.
void prepare_for_mixed_precision(torch::nn::Module& network) {
  network.to(torch::kBFloat16);
  for (Tensor& parameter : network.parameters()) {
    if (parameter.dim() == 4) parameter.set_data(parameter.contiguous(torch::MemoryFormat::ChannelsLast));
  }
}

}  // namespace

Ensemble::Ensemble(const std::vector<fs::path>& weights, torch::Device device) {
  for (const fs::path& file : weights) {
    ColorizerNet member = load_colorizer_weights(file).network;
    member->to(device);
    if (device.is_cuda()) prepare_for_mixed_precision(*member);
    members_.push_back(member);
  }
}

Tensor Ensemble::probability(const Tensor& lightness, SequentialRng& rng) {
  const torch::NoGradGuard no_grad;
  const Tensor logits = members_[rng.below(std::uint32_t(members_.size()))]->forward(lightness);
  return torch::softmax(logits.permute({0, 2, 3, 1}).reshape({-1, kAbBinCount}).to(torch::kFloat32), 1);
}

}  // namespace cnerf
