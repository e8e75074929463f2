#pragma once
/// A hash grid and a small net over points, 4 L -> 64 -> outputs, on the GPU: what the chroma fields of stage 2 are
/// made of. There are two of them: 64 features behind a ReLU, and two plain numbers (log chromaticity).

#include <cuda_runtime_api.h>

#include <cstdint>
#include <vector>

#include "encoding/cuda/hash_grid_cuda.h"
#include "src/base/vec3.h"
#include "src/field/cuda/dense_layer.h"

namespace cnerf {

enum class PointOutputs { kFeatures, kNumbers };

inline constexpr int kPointFeatures = 64;
inline constexpr int kPointNumbers = 4;  ///< two, padded to what the CPU's kernels want

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

struct PointBackwardJob {
  int levels;
  PackedWeights weights;
  SampleCount samples;
  const uint4* encoded;  ///< [most, 16 KT] halves
  // Of features: a sample's gradient is its share of its pixel's.
  const float4* places = nullptr;       ///< w holds the bits of the pixel's number
  const float* shares = nullptr;        ///< [most]
  const float* d_composited = nullptr;  ///< [pixels, 64]
  float d_feature = 0;                  ///< a sample's share of this times its features is added
  // Of numbers:
  const float2* d_numbers = nullptr;  ///< [most]
  void* d_encoded;                    ///< [levels, most, 4] of bfloat16, written
  float* d_weights;  ///< [point_backward_blocks(), point_weight_count()], written: a part of each block
};
void point_backward(PointOutputs outputs, const PointBackwardJob& job, cudaStream_t stream);

/// Parts that the gradient of the weights comes in.
[[nodiscard]] int point_backward_blocks();
/// Padded weights of both layers; as many 16-bit numbers are packed.
[[nodiscard]] int point_weight_count(PointOutputs outputs, int levels);
/// Both layers, for their optimiser.
/// @param forward, backward  [point_weight_count()] packed
[[nodiscard]] std::vector<DenseLayer> point_layers(PointOutputs outputs, int levels, TrainedWeights trained,
                                                   uint2* forward, uint2* backward);

}  // namespace cnerf
