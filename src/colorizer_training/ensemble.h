#pragma once
/// Trained networks whose common answer another one learns.

#include <torch/torch.h>

#include <filesystem>
#include <vector>

#include "src/base/rng.h"
#include "src/colorizer/torch/network.h"

namespace cnerf {

class Ensemble {
 public:
  Ensemble() = default;
  /// @param weights  files of `save_colorizer_weights`, as training left them: logits of rebalanced classes.
  /// @throws MissingInputError, InputError.
  Ensemble(const std::vector<std::filesystem::path>& weights, torch::Device device);

  [[nodiscard]] bool empty() const { return members_.empty(); }

  /// The distributions of one member that `rng` draws, without gradients. Over many steps they teach what the mean of
  /// all would: cross-entropy is linear in its target.
  /// @param lightness  [B, 1, H, W] f32, L*.
  /// @return           [B ceil(H/4) ceil(W/4), 313] f32, block by block in rows.
  [[nodiscard]] torch::Tensor probability(const torch::Tensor& lightness, SequentialRng& rng);

 private:
  std::vector<ColorizerNet> members_;
};

}  // namespace cnerf
