#include <cuda_bf16.h>

#include "encoding/cuda/hash_grid_cuda.h"
#include "encoding/cuda/hash_grid_device.cuh"
#include "src/base/cuda/launch.h"

namespace cnerf {
namespace {

constexpr int kThreads = 256;
constexpr int kRun = 16;    // successive samples of eight threads of the backward kernel
constexpr int kLoaded = 4;  // of them at once

/// Blocks of one level follow one another, so that the gradients of that level stay in L2.
__global__ void __launch_bounds__(kThreads)
    scatter(const __grid_constant__ GridLevels levels, const float4* __restrict__ places, const std::uint32_t* count,
            std::uint32_t most, const uint2* __restrict__ d_encoded, float* __restrict__ d_table) {
  const std::uint32_t n = min(*count, most);
  const std::uint32_t first = (blockIdx.x * kThreads + threadIdx.x) / 8 * kRun;
  if (first >= n) return;
  const GridLevel& level = levels.level[blockIdx.y];
  const uint2* d_level = d_encoded + std::size_t(blockIdx.y) * most;

  CornerRun run(level, threadIdx.x % 8, d_table + 4 * std::size_t(level.first_row));
  for (std::uint32_t begin = first; begin < min(first + kRun, n); begin += kLoaded) {
    float4 place[kLoaded];
    uint2 d[kLoaded];
#pragma unroll
    for (std::uint32_t i = 0; i < kLoaded; ++i) {
      place[i] = __ldg(places + min(begin + i, n - 1));
      d[i] = begin + i < n ? __ldg(d_level + begin + i) : make_uint2(0, 0);
    }
#pragma unroll
    for (std::uint32_t i = 0; i < kLoaded; ++i) {
      const float2 low = __bfloat1622float2(*reinterpret_cast<const __nv_bfloat162*>(&d[i].x));
      const float2 high = __bfloat1622float2(*reinterpret_cast<const __nv_bfloat162*>(&d[i].y));
      const float position[3] = {place[i].x, place[i].y, place[i].z};
      run.add(position, make_float4(low.x, low.y, high.x, high.y));
    }
  }
  run.write();
}

}  // namespace

void encode_backward_cuda(const std::vector<GridLevel>& levels, const float4* places, SampleCount samples,
                          const void* d_encoded, float4* d_table, cudaStream_t stream) {
  const dim3 grid(blocks_for((samples.most + kRun - 1) / kRun * 8, kThreads), unsigned(levels.size()));
  scatter<<<grid, kThreads, 0, stream>>>(GridLevels(levels.data(), levels.size()), places, samples.count, samples.most,
                                         static_cast<const uint2*>(d_encoded), reinterpret_cast<float*>(d_table));
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
