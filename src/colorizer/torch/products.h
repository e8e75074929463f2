#pragma once
/// What the convolutions of colorizers multiply on the processor.

#include <torch/torch.h>

#include "src/base/cpu_features.h"

namespace cnerf {

/// Products of bf16 numbers where the processor multiplies them at twice the rate, as the nets of fields do: see
/// IsaLevel. Sums are floats.
[[nodiscard]] inline torch::ScalarType product_type() {
  return active_isa() == IsaLevel::kAvx512Bf16 ? torch::kBFloat16 : torch::kFloat32;
}

/// A network that only answers from now on, by the processor: once here, instead of in every convolution.
inline void prepare_for_answers(torch::nn::Module& network) {
  for (torch::Tensor& parameter : network.parameters()) {
    parameter.set_requires_grad(false);
    parameter.set_data(parameter.to(product_type()));
    if (parameter.dim() == 4) parameter.set_data(parameter.contiguous(at::MemoryFormat::ChannelsLast));
  }
}

}  // namespace cnerf
