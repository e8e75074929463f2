#pragma once
/// A hash grid and a small net over points, 4 L -> 64 -> outputs, on the GPU, of which the colour fields of stage 2
/// consist. There are two kinds: 64 features after a ReLU, and two plain numbers (log chromaticity).

#include <cuda_runtime_api.h>

#include <cstdint>
#include <vector>

#include "encoding/cuda/hash_grid_cuda.h"
#include "src/base/vec3.h"
#include "src/field/cuda/dense_layer.h"

namespace cnerf {

enum class PointOutputs { kFeatures, kNumbers };

inline constexpr int kPointFeatures = 64;
inline constexpr int kPointNumbers = 4;  ///< two, padded to the block size of the CPU's kernels

struct PointForwardJob {
  const std::vector<GridLevel>* levels;
  const uint2* table;      ///< [rows, 4] halves
  const uint2* weights;    ///< packed forward weights
  const Vec3f* positions;  ///< [count], unit space; clamped to [0, 1]
  std::uint32_t count;
  uint4* encoded = nullptr;           ///< [count, 16 KT] halves, written where it is not null
  std::uint32_t* features = nullptr;  ///< [count, 64] halves, written by nets of features
  float2* numbers = nullptr;          ///< [count], written by nets of two numbers
};
void point_forward(PointOutputs outputs, const PointForwardJob& job, cudaStream_t stream);

/// What the gradient of the outputs is computed from.
struct PointGradient {
  // For features: a sample receives its share of its pixel's gradient.
  const float* shares = nullptr;        ///< [most]
  const float* d_composited = nullptr;  ///< [pixels, 64]
  float d_feature = 0;                  ///< plus its share of this factor times its own features
  // For numbers:
  const float2* d_numbers = nullptr;  ///< [most]
};

struct PointBackwardJob {
  int levels;
  PackedWeights weights;
  SampleCount samples;
  const uint4* encoded;  ///< [most, 16 KT] halves
  const float4* places;  ///< w holds the bits of the pixel's number
  PointGradient gradient;
  void* d_encoded;   ///< [levels, most, 4] of bfloat16, written
  float* d_weights;  ///< [point_backward_blocks(), point_weight_count()], written: a part of each block
};
void point_backward(PointOutputs outputs, const PointBackwardJob& job, cudaStream_t stream);

/// Number of parts in which the gradient of the weights is written.
[[nodiscard]] int point_backward_blocks();
/// Padded weights of both layers; as many 16-bit numbers are packed.
[[nodiscard]] int point_weight_count(PointOutputs outputs, int levels);
/// Both layers, for their optimiser.
/// @param packed  [point_weight_count()]
[[nodiscard]] std::vector<DenseLayer> point_layers(PointOutputs outputs, int levels, TrainedWeights trained,
                                                   PackedWeights packed);

}  // namespace cnerf
