#pragma once
/// The hash grid as a LibTorch module, for people who build on it. The engines do not use it.

#include <torch/torch.h>

#include <vector>

#include "encoding/hash_grid_levels.h"

namespace cnerf {

/// Mueller et al. 2022, Sec. 3, with F = 4. Differentiable in the table; positions are constants.
class HashGridImpl : public torch::nn::Module {
 public:
  explicit HashGridImpl(const HashGridOptions& options = {}, std::uint64_t seed = 1);

  /// @param positions  [n, 3] f32 on the CPU, in [0, 1]
  /// @return           [n, 4 L] f32
  /// @throws ContractError  on another shape, dtype or device, or positions outside [0, 1].
  torch::Tensor forward(const torch::Tensor& positions);

  torch::Tensor table;  ///< parameter, [rows, 4] f32
  [[nodiscard]] const std::vector<GridLevel>& levels() const { return levels_; }

 private:
  std::vector<GridLevel> levels_;
};
TORCH_MODULE(HashGrid);

}  // namespace cnerf
