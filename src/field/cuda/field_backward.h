#pragma once
/// Backward pass of stage 1's nets over the samples of a step, from the gradient of their outputs to that of the hash
/// grid's features and of the weights.

#include <cuda_runtime_api.h>

#include <cstdint>
#include <vector>

#include "encoding/cuda/hash_grid_cuda.h"
#include "src/field/cuda/field_weights.h"

namespace cnerf {

/// Samples of a training step with the gradient of the loss, in device memory.
struct FieldSamples {
  SampleCount count;
  const float4* places = nullptr;             ///< x, y, z in [0, 1]; w holds the bits of the ray's number
  const DirectionCode* directions = nullptr;  ///< of the rays
  const uint4* encoded = nullptr;             ///< [most, 16 KT] halves
  const float2* gradients = nullptr;          ///< by the luminance net's raw output and by log density
};

struct FieldBackwardJob {
  int levels;
  PackedField nets;
  FieldSamples samples;
  void* d_encoded;   ///< [levels, most, 4] of bfloat16, written
  float* d_weights;  ///< [field_backward_blocks(), FieldShape::kWeights], written: a part of each block
};

/// Number of parts in which the gradient of the weights is written.
[[nodiscard]] int field_backward_blocks();
[[nodiscard]] int field_weight_count(int levels);
void field_backward(const FieldBackwardJob& job, cudaStream_t stream);

/// The field's parameters in device memory.
struct FieldParameters {
  TrainedWeights density, luminance;  ///< as mlp_layout.h orders them
  PackedWeights packed;
  float* last_layer;
};
/// The layers of both nets, in the order of their gradient.
[[nodiscard]] std::vector<DenseLayer> field_layers(int levels, const FieldParameters& parameters);

}  // namespace cnerf
