#include "src/colorizer/torch/products.h"

#include <torch/version.h>

#include <cstdlib>

#include "src/base/cpu_features.h"

namespace cnerf {
namespace {

// With the oneDNN of LibTorch 1.13 (2.6), bf16 convolutions by AMX answered differently each time, and it crashed in
// its generator of their code. oneDNN reads the variable once, at its first operation.
[[maybe_unused]] const bool kWithoutAmx =
    TORCH_VERSION_MAJOR < 2 && ::setenv("ONEDNN_MAX_CPU_ISA", "AVX512_CORE_BF16", /*overwrite=*/0) == 0;

}  // namespace

torch::ScalarType product_type() {
  return active_isa() == IsaLevel::kAvx512Bf16 ? torch::kBFloat16 : torch::kFloat32;
}

void prepare_for_answers(torch::nn::Module& network) {
  for (torch::Tensor& parameter : network.parameters()) {
    parameter.set_requires_grad(false);
    parameter.set_data(parameter.to(product_type()));
    if (parameter.dim() == 4) parameter.set_data(parameter.contiguous(at::MemoryFormat::ChannelsLast));
  }
}

}  // namespace cnerf
