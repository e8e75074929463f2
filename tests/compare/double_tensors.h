#pragma once
/// Tensors of doubles, for checks against finite differences.

#include <torch/torch.h>

#include <vector>

namespace cnerf::test {

inline const auto kDouble = torch::TensorOptions().dtype(torch::kFloat64);

/// The values of a tensor of doubles, in order.
inline std::vector<double> doubles(const torch::Tensor& values) {
  const torch::Tensor flat = values.detach().contiguous().view({-1});
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

}  // namespace cnerf::test
