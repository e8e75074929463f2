#pragma once
/// The hash grid's kernels on their own. The engine gathers inside its ray kernel instead (hash_grid_device.cuh) and
/// shares the backward kernel; forward and backward together are what a test or another program calls.

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

/// @param table      [rows, 4] halves
/// @param places     [most] of float4: x, y, z in [0, 1]; w is not looked at
/// @param encoded    [most, L, 4] halves, written
void encode_cuda(const std::vector<GridLevel>& levels, const void* table, const float* places, SampleCount samples,
                 void* encoded, cudaStream_t stream);

/// Adds the gradient of the table, run by run: float sums in an order that varies from call to call.
/// @param d_encoded  [L, most, 4] of bfloat16
/// @param d_table    [rows, 4] floats
void encode_backward_cuda(const std::vector<GridLevel>& levels, const float* places, SampleCount samples,
                          const void* d_encoded, float* d_table, cudaStream_t stream);

}  // namespace cnerf
