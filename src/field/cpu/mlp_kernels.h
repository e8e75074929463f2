#pragma once
/// CPU kernels of one fully connected layer, one table of functions per instruction set. Arrays are grouped [G, C, 16]
/// as in encoding/cpu/hash_grid_kernels.h; "stride" is the C of the array that holds them, so that a layer can read or
/// write a part of the channels of a wider array.

#include <cstddef>

#include "src/base/cpu_features.h"

namespace cnerf {

struct MlpKernels {
  /// out = W in, then ReLU if `relu`.
  /// @param w_transposed  [in, out]
  void (*forward)(const float* w_transposed, int inputs, int outputs, const float* in, int in_stride, float* out,
                  int out_stride, std::size_t groups, bool relu);
  /// d_in = W^T d_out, set to zero where `activation` <= 0 (the ReLU that made `in`; null = none).
  /// @param w           [out, in]
  /// @param activation  [G, activation_stride, 16], the layer's input as `forward` saw it
  void (*backward_input)(const float* w, int inputs, int outputs, const float* d_out, int d_out_stride, float* d_in,
                         int d_in_stride, std::size_t groups, const float* activation, int activation_stride);
  /// d_w += sum over samples of d_out in^T.
  /// @param d_w  [out, in]
  void (*backward_weights)(const float* in, int in_stride, const float* d_out, int d_out_stride, std::size_t groups,
                           int inputs, int outputs, float* d_w);
};

namespace generic {
extern const MlpKernels kMlpKernels;
}
namespace neon {
extern const MlpKernels kMlpKernels;
}
namespace avx2 {
extern const MlpKernels kMlpKernels;
}
namespace avx512 {
extern const MlpKernels kMlpKernels;
}
/// Products of numbers rounded to bf16; sums of floats.
namespace avx512bf16 {
extern const MlpKernels kMlpKernels;
}

/// The kernels of `active_isa()`.
[[nodiscard]] inline const MlpKernels& mlp_kernels() {
  if constexpr (kHasNeon) {
    return kernels_of_isa(generic::kMlpKernels, neon::kMlpKernels);
  } else {
    if (active_isa() == IsaLevel::kAvx512Bf16) return avx512bf16::kMlpKernels;
    return kernels_of_isa(generic::kMlpKernels, avx2::kMlpKernels, avx512::kMlpKernels);
  }
}

}  // namespace cnerf
