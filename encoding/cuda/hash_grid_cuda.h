#pragma once
/// The hash grid's backward pass. Kernels gather its features themselves (hash_grid_device.cuh).

#include <cuda_runtime_api.h>

#include <cstdint>
#include <vector>

#include "encoding/hash_grid_levels.h"

namespace cnerf {

/// Samples whose number is only known on the GPU.
struct SampleCount {
  const std::uint32_t* count;  ///< device memory
  std::uint32_t most;          ///< bounds it; the arrays' capacity
};

/// Adds the gradient of the table, run by run: float sums in an order that varies from call to call.
/// @param places     [most] x, y, z in [0, 1]
/// @param d_encoded  [L, most, 4] of bfloat16
/// @param d_table    [rows]
void encode_backward_cuda(const std::vector<GridLevel>& levels, const float4* places, SampleCount samples,
                          const void* d_encoded, float4* d_table, cudaStream_t stream);

/// What the gradient by samples' positions is made of.
struct PositionSlopes {
  std::vector<GridLevel> levels;     ///< that count, coarsest first
  const uint2* table = nullptr;      ///< [rows, 4] halves
  const uint2* d_encoded = nullptr;  ///< [L, most, 4] of bfloat16
};

}  // namespace cnerf
