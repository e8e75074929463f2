#include <cuda_bf16.h>
#include "encoding/cuda/hash_grid_device.cuh"
#include "src/base/cuda/launch.h"

#include "src/optim/cuda/row_adam_cuda.h"

namespace cnerf {
namespace {

constexpr unsigned kThreads = 128;

__device__ bool is_zero(const float4& d) {
  return d.x == 0 && d.y == 0 && d.z == 0 && d.w == 0;
}

/// A bfloat16 in the upper half of a word is the float.
__device__ float4 unpacked(const uint2& packed) {
  return make_float4(__uint_as_float(packed.x << 16), __uint_as_float(packed.x & 0xffff0000u),
                     __uint_as_float(packed.y << 16), __uint_as_float(packed.y & 0xffff0000u));
}
__device__ std::uint32_t packed_pair(float low, float high) {
  const __nv_bfloat162 pair = __floats2bfloat162_rn(low, high);
  return std::uint32_t(__bfloat16_as_ushort(pair.x)) | std::uint32_t(__bfloat16_as_ushort(pair.y)) << 16;
}

__global__ void pack(const TableRowsCuda rows, uint2* packed) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row >= rows.count) return;
  const float4 d = rows.gradient[row];
  packed[row] = make_uint2(packed_pair(d.x, d.y), packed_pair(d.z, d.w));
  if (!is_zero(d)) rows.gradient[row] = make_float4(0, 0, 0, 0);
}

/// @param packed  null: the rows' own gradient, which is cleared
__global__ void update(const TableRowsCuda rows, const uint2* packed, const AdamStep* adam, float decay) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row >= rows.count) return;
  const float4 d = packed == nullptr ? rows.gradient[row] : unpacked(packed[row]);
  if (is_zero(d)) return;
  const AdamStep step = *adam;
  const float kept = step.kept(decay);
  float4* moments = rows.moments + 2 * std::size_t(row);
  float4 value = rows.values[row], first = moments[0], second = moments[1];
  step.apply(d.x, first.x, second.x, value.x, kept);
  step.apply(d.y, first.y, second.y, value.y, kept);
  step.apply(d.z, first.z, second.z, value.z, kept);
  step.apply(d.w, first.w, second.w, value.w, kept);
  rows.values[row] = value;
  moments[0] = first;
  moments[1] = second;
  if (packed == nullptr) rows.gradient[row] = make_float4(0, 0, 0, 0);
  rows.halves[row] = halves_of(value);
}

__global__ void round(const TableRowsCuda rows) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row < rows.count) rows.halves[row] = halves_of(rows.values[row]);
}

}  // namespace

void update_rows(const TableRowsCuda& rows, const uint2* packed, const AdamStep* adam, float decay,
                 cudaStream_t stream) {
  update<<<blocks_for(rows.count, kThreads), kThreads, 0, stream>>>(rows, packed, adam, decay);
  CNERF_CUDA(cudaGetLastError());
}

void pack_gradient(const TableRowsCuda& rows, uint2* packed, cudaStream_t stream) {
  pack<<<blocks_for(rows.count, kThreads), kThreads, 0, stream>>>(rows, packed);
  CNERF_CUDA(cudaGetLastError());
}

void round_rows(const TableRowsCuda& rows, cudaStream_t stream) {
  round<<<blocks_for(rows.count, kThreads), kThreads, 0, stream>>>(rows);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
