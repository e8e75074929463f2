#pragma once
/// Sums across a warp. All 32 lanes call them together.

namespace cnerf {

__device__ inline float warp_sum(float value) {
#pragma unroll
  for (int offset = 16; offset > 0; offset /= 2) value += __shfl_xor_sync(~0u, value, offset);
  return value;
}
/// Sum of the lanes up to and including this one.
__device__ inline float warp_prefix_sum(float value) {
  const unsigned lane = threadIdx.x % 32;
#pragma unroll
  for (unsigned offset = 1; offset < 32; offset *= 2) {
    const float before = __shfl_up_sync(~0u, value, offset);
    if (lane >= offset) value += before;
  }
  return value;
}

}  // namespace cnerf
