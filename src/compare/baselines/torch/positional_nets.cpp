#include "src/compare/baselines/torch/positional_nets.h"

#include <cmath>

#include "src/base/rng.h"

namespace cnerf::compare {

std::vector<float> floats_of(const torch::Tensor& values) {
  const torch::Tensor host = values.detach().to(torch::kCPU).contiguous();
  return {host.data_ptr<float>(), host.data_ptr<float>() + host.numel()};
}

torch::Tensor uniform(std::uint64_t seed, std::uint64_t stream, torch::IntArrayRef shape) {
  torch::Generator generator = torch::make_generator<torch::CPUGeneratorImpl>(mix_bits(seed ^ mix_bits(stream)));
  return torch::rand(shape, generator, torch::kFloat32).to(torch_device());
}

void initialise(torch::nn::Module& module, std::uint64_t seed) {
  const torch::NoGradGuard no_gradient;
  std::uint64_t stream = 0;
  for (const auto& child : module.modules(/*include_self=*/false)) {
    auto* linear = child->as<torch::nn::Linear>();
    if (linear == nullptr) continue;
    const double bound = 1.0 / std::sqrt(double(linear->weight.size(1)));
    for (torch::Tensor& parameter : linear->parameters()) {
      parameter.copy_((2 * uniform(seed, ++stream, parameter.sizes()) - 1) * bound);
    }
  }
}

std::vector<torch::Tensor> joined(std::vector<torch::Tensor> a, const std::vector<torch::Tensor>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Trained::Trained(const std::vector<torch::Tensor>& parameters) : parameters_(parameters) {
  const torch::NoGradGuard no_gradient;
  std::vector<torch::Tensor> flat;
  for (const torch::Tensor& parameter : parameters_) flat.push_back(parameter.detach().flatten());
  values_ = torch::cat(flat);
  mean_ = torch::zeros_like(values_);
  square_ = torch::zeros_like(values_);
  std::int64_t begin = 0;
  for (torch::Tensor& parameter : parameters_) {  // from now on, a part of `values_`
    parameter.set_data(values_.narrow(0, begin, parameter.numel()).view(parameter.sizes()));
    begin += parameter.numel();
  }
}

void Trained::follow(double learning_rate, std::int64_t step) {
  const torch::NoGradGuard no_gradient;
  constexpr double kMeanDecay = 0.9, kSquareDecay = 0.999, kTiny = 1e-8;
  std::vector<torch::Tensor> flat;
  for (torch::Tensor& parameter : parameters_) {
    flat.push_back(parameter.grad().defined() ? parameter.grad().flatten() : torch::zeros_like(parameter).flatten());
  }
  const torch::Tensor gradient = torch::cat(flat);
  for (torch::Tensor& parameter : parameters_) parameter.mutable_grad() = torch::Tensor();
  mean_.mul_(kMeanDecay).add_(gradient, 1 - kMeanDecay);
  square_.mul_(kSquareDecay).addcmul_(gradient, gradient, 1 - kSquareDecay);
  const double unbiased_mean = 1 - std::pow(kMeanDecay, double(step));
  const double unbiased_square = 1 - std::pow(kSquareDecay, double(step));
  values_.addcdiv_(mean_, (square_ / unbiased_square).sqrt_().add_(kTiny), -learning_rate / unbiased_mean);
}

void Trained::append_state(const std::string& prefix, std::vector<StatePiece>& state) {
  host_ = {values_.to(torch::kCPU), mean_.to(torch::kCPU), square_.to(torch::kCPU)};
  const char* names[] = {".values", ".mean", ".square"};
  for (std::size_t i = 0; i < host_.size(); ++i) {
    auto* bytes = reinterpret_cast<std::byte*>(host_[i].data_ptr<float>());
    state.push_back({prefix + names[i], {bytes, sizeof(float) * std::size_t(host_[i].numel())}});
  }
}

void Trained::state_loaded() {
  const torch::NoGradGuard no_gradient;
  values_.copy_(host_.at(0));
  mean_.copy_(host_.at(1));
  square_.copy_(host_.at(2));
}

}  // namespace cnerf::compare
