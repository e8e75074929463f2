#include "src/colorizer_training/flat_parameters.h"

#include <cmath>

namespace cnerf::colorizer_training {
using torch::Tensor;

namespace {

constexpr double kWeightDecay = 0.05, kBeta1 = 0.9, kBeta2 = 0.98, kEpsilon = 1e-8, kClipNorm = 1;

/// A view of `flat` at `offset` with the shape of `like`; convolution weights lie channels-last in it.
Tensor view_like(const Tensor& flat, std::int64_t offset, const Tensor& like) {
  const Tensor piece = flat.narrow(0, offset, like.numel());
  if (like.dim() != 4) return piece.view(like.sizes());
  return piece.view({like.size(0), like.size(2), like.size(3), like.size(1)}).permute({0, 3, 1, 2});
}

std::int64_t total_size(const std::vector<Tensor>& tensors) {
  std::int64_t total = 0;
  for (const Tensor& tensor : tensors) total += tensor.numel();
  return total;
}

}  // namespace

FlatParameters::FlatParameters(const std::vector<torch::nn::Module*>& modules) {
  const torch::NoGradGuard no_grad;
  std::vector<Tensor> parameters, statistics;
  for (const auto* module : modules) {
    for (const Tensor& parameter : module->parameters()) parameters.push_back(parameter);
    for (const Tensor& buffer : module->buffers()) {
      if (buffer.is_floating_point()) statistics.push_back(buffer);
    }
  }
  const auto options = parameters.at(0).options().requires_grad(false);
  values = torch::zeros({total_size(parameters)}, options);
  gradients = torch::zeros_like(values);
  decay_mask = torch::zeros_like(values);
  buffers = torch::zeros({total_size(statistics)}, options);

  std::int64_t offset = 0;
  for (Tensor& parameter : parameters) {
    const Tensor view = view_like(values, offset, parameter);
    view.copy_(parameter);
    if (parameter.dim() >= 2) decay_mask.narrow(0, offset, parameter.numel()).fill_(1);
    parameter.set_data(view);
    parameter.mutable_grad() = view_like(gradients, offset, parameter);
    offset += parameter.numel();
  }
  offset = 0;
  for (Tensor& buffer : statistics) {
    const Tensor view = view_like(buffers, offset, buffer);
    view.copy_(buffer);
    buffer.set_data(view);
    offset += buffer.numel();
  }
}

FlatAdamW::FlatAdamW(FlatParameters& parameters)
    : first_moment(torch::zeros_like(parameters.values)),
      second_moment(torch::zeros_like(parameters.values)),
      parameters_(parameters) {}

void FlatAdamW::step(double learning_rate, std::int64_t step) {
  const torch::NoGradGuard no_grad;
  Tensor& gradient = parameters_.gradients;
  gradient.mul_((kClipNorm / (gradient.norm() + 1e-6)).clamp_max(1));
  first_moment.lerp_(gradient, 1 - kBeta1);
  second_moment.mul_(kBeta2).addcmul_(gradient, gradient, 1 - kBeta2);
  const double correction1 = 1 - std::pow(kBeta1, double(step));
  const double correction2 = 1 - std::pow(kBeta2, double(step));
  parameters_.values.mul_(1 - learning_rate * kWeightDecay * parameters_.decay_mask);
  const Tensor denominator = (second_moment / correction2).sqrt_().add_(kEpsilon);
  parameters_.values.addcdiv_(first_moment, denominator, -learning_rate / correction1);
  gradient.zero_();
}

}  // namespace cnerf::colorizer_training
