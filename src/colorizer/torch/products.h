#pragma once
/// What the convolutions of colorizers multiply on the processor.

#include <torch/torch.h>

namespace cnerf {

/// Products of bf16 numbers where the processor multiplies them at twice the rate, as the nets of fields do: see
/// IsaLevel. Sums are floats.
[[nodiscard]] torch::ScalarType product_type();

/// A network that only answers from now on, by the processor: once here, instead of in every convolution.
void prepare_for_answers(torch::nn::Module& network);

}  // namespace cnerf
