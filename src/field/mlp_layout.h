#pragma once
/// The shape of a small fully connected net without biases: ReLU between its layers, none after the last one.

#include <cstddef>
#include <vector>

namespace cnerf {

/// Widths are multiples of 4 (pad with zero weights): the kernels work on blocks.
struct MlpLayout {
  std::vector<int> widths;  ///< inputs, hidden…, outputs

  [[nodiscard]] int layers() const { return int(widths.size()) - 1; }
  [[nodiscard]] int inputs() const { return widths.front(); }
  /// Offset, in floats, of the [out, in] weights of a layer; `weight_offset(layers())` is the number of weights.
  [[nodiscard]] std::size_t weight_offset(int layer) const {
    std::size_t offset = 0;
    for (int l = 0; l < layer; ++l) offset += std::size_t(widths[l]) * std::size_t(widths[l + 1]);
    return offset;
  }
  [[nodiscard]] std::size_t weight_count() const { return weight_offset(layers()); }
};

/// Uniform in +-sqrt(6 / inputs) (He et al. 2015, for ReLU), a pure function of (seed, stream).  [weight_count]
[[nodiscard]] std::vector<float> initial_weights(const MlpLayout& layout, unsigned long long seed,
                                                 unsigned long long stream);

}  // namespace cnerf
