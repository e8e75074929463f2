#pragma once
/// Backward pass of stage 1's nets over the samples of a step, from the gradient of their outputs to that of the hash
/// grid's features and of the weights.

#include <cuda_runtime_api.h>

#include <cstdint>
#include <vector>

#include "encoding/cuda/hash_grid_cuda.h"
#include "src/field/cuda/field_weights.h"

namespace cnerf {

struct FieldBackwardJob {
  int levels;
  PackedField nets;
  SampleCount samples;
  const float4* places;             ///< w holds the bits of the ray's number
  const DirectionCode* directions;  ///< of the rays
  const uint4* encoded;             ///< [most, 16 KT] halves
  const float2* gradients;          ///< by the luminance net's raw output and by log density
  void* d_encoded;                  ///< [levels, most, 4] of bfloat16, written
  float* d_weights;                 ///< [field_backward_blocks(), FieldShape::kWeights], written: a part of each block
};

/// Parts that the gradient of the weights comes in.
[[nodiscard]] int field_backward_blocks();
[[nodiscard]] int field_weight_count(int levels);
void field_backward(const FieldBackwardJob& job, cudaStream_t stream);

/// Where the weights of the field lie on the GPU.
struct FieldParameters {
  TrainedWeights density, luminance;  ///< as mlp_layout.h orders them
  uint2 *forward, *backward;          ///< packed
  float* last_layer;
};
/// The layers of both nets, in the order of their gradient.
[[nodiscard]] std::vector<DenseLayer> field_layers(int levels, const FieldParameters& parameters);

}  // namespace cnerf
