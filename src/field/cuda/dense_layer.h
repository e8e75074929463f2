#pragma once
/// The weights of a layer on the GPU: as floats for the optimiser, and packed in 16 bits in the order in which lanes
/// read the tensor cores' right operands.

#include <cuda_runtime_api.h>

#include <vector>

#include "src/base/device_sums.h"
#include "src/base/host_device.h"
#include "src/optim/adam.h"

namespace cnerf {

/// Place, in 16-bit numbers, of input k and output n of a packed layer with `outputs` outputs (tensor_core.cuh).
CNERF_HD constexpr int packed_place(int k, int n, int outputs) {
  const int tile = k / 16 * (outputs / 8) + n / 8;
  const int lane = n % 8 * 4 + k % 8 / 2;
  return (((tile * 32 + lane) * 2) + k % 16 / 8) * 2 + k % 2;
}

/// Packed weights of a net.
struct PackedWeights {
  uint2* forward;   ///< halves
  uint2* backward;  ///< bfloat16, transposed: inputs and outputs change places
};

/// Parameters and their optimiser state.
struct TrainedWeights {
  float *values = nullptr, *first_moments = nullptr, *second_moments = nullptr;

  [[nodiscard]] TrainedWeights from(int first) const {
    return {values + first, first_moments + first, second_moments + first};
  }
};

/// One layer without biases. Kernels work on multiples of 16 inputs and outputs; padding has weight 0.
struct DenseLayer {
  int inputs = 0, outputs = 0;                ///< of the floats
  int padded_inputs = 0, padded_outputs = 0;  ///< of the packed weights, and of the gradient
  int backward_inputs = 0;                    ///< leading padded inputs whose gradient is needed
  TrainedWeights trained;                     ///< [outputs, inputs]
  uint2* forward = nullptr;                   ///< [padded_inputs, padded_outputs] halves; null: not packed
  uint2* backward = nullptr;                  ///< [padded_outputs, backward_inputs] bfloat16
  float* plain = nullptr;                     ///< [padded_outputs, padded_inputs] floats, of a layer that is not packed
};

/// A step of Adam on layers: sums the parts of their gradient, updates the weights and packs them again.
/// @param d_weights  [parts][layer][padded_outputs, padded_inputs]; null: only pack
/// @param adam       device memory
void update_layers(const std::vector<DenseLayer>& layers, const float* d_weights, int parts, const AdamStep* adam,
                   cudaStream_t stream);

/// The gradient that `update_layers` would sum, as its only part.
/// @param weights  of all layers, padded
/// @param sum      [weights], written
void sum_gradient_parts(const float* d_weights, int parts, int weights, float* sum, cudaStream_t stream);
/// The same over several processes as well, in place of the first part.
void sum_gradient_parts(float* d_weights, int parts, int weights, DeviceSums& sums, cudaStream_t stream);

}  // namespace cnerf
