#pragma once
/// A small trainable net on the CPU: weights in the two layouts that the kernels read, and optimiser state.

#include <cstdint>
#include <string>
#include <vector>

#include "src/base/aligned.h"
#include "src/field/cpu/mlp_kernels.h"
#include "src/field/mlp_layout.h"
#include "src/field/state.h"
#include "src/optim/adam.h"

namespace cnerf {

/// Some channels of a grouped array [G, stride, 16].
struct Channels {
  float* data = nullptr;  ///< the first channel of the first group
  int stride = 0;         ///< channels of the whole array
};

class MlpCpu {
 public:
  /// @param relu_output  ReLU behind the last layer as well
  MlpCpu(MlpLayout layout, std::uint64_t seed, std::uint64_t stream, bool relu_output = false);

  [[nodiscard]] const MlpLayout& layout() const { return layout_; }

  /// @param activations  layers() + 1 arrays: [0] the input; the others are written, hidden ones after ReLU.
  void forward(const std::vector<Channels>& activations, std::size_t groups) const;
  /// @param gradients  layers() + 1 arrays beside the activations: the last one is given (behind its ReLU, if
  ///                   it has one, it must be zero where the activation is), the others are written;
  ///                   [0] may have null data where the input's gradient is not needed.
  /// @param d_weights  [weight_count], added to
  void backward(const std::vector<Channels>& activations, const std::vector<Channels>& gradients, std::size_t groups,
                float* d_weights) const;
  void update(const std::vector<float>& d_weights, const AdamStep& step);

  [[nodiscard]] const AlignedVector<float>& weights() const { return weights_; }
  void set_weights(const std::vector<float>& weights);
  void append_state(const std::string& prefix, std::vector<StatePiece>& state);
  /// To be called after a snapshot was loaded into the state.
  void transpose_weights();

 private:
  MlpLayout layout_;
  bool relu_output_;
  const MlpKernels* kernels_;
  AlignedVector<float> weights_;     ///< [layer][out, in]
  AlignedVector<float> transposed_;  ///< [layer][in, out]
  AlignedVector<float> first_moments_, second_moments_;
};

}  // namespace cnerf
