#pragma once
/// Sums and ballots over a warp, or over groups of its lanes that work on separate problems. All 32 lanes must call
/// them together.

#include <cstdint>

namespace cnerf {

/// @tparam kLanes  of a group, a power of two
template <int kLanes = 32>
__device__ inline float warp_sum(float value) {
#pragma unroll
  for (int offset = kLanes / 2; offset > 0; offset /= 2) value += __shfl_xor_sync(~0u, value, offset);
  return value;
}
/// Sum of the group's lanes up to and including this one.
template <int kLanes = 32>
__device__ inline float warp_prefix_sum(float value) {
  const unsigned lane = threadIdx.x % kLanes;
#pragma unroll
  for (unsigned offset = 1; offset < kLanes; offset *= 2) {
    const float before = __shfl_up_sync(~0u, value, offset, kLanes);
    if (lane >= offset) value += before;
  }
  return value;
}
/// One bit per lane of the group, lane 0 lowest.
template <int kLanes = 32>
__device__ inline unsigned warp_ballot(bool yes) {
  const unsigned all = __ballot_sync(~0u, yes);
  if constexpr (kLanes == 32) return all;
  return (all >> (threadIdx.x % 32 / kLanes * kLanes)) & ((1u << kLanes % 32) - 1u);
}

/// The lanes around this one that follow one another with the same key. Others may have that key too.
class WarpSegment {
 public:
  __device__ explicit WarpSegment(std::uint32_t key) {
    const unsigned lane = threadIdx.x % 32;
    const std::uint32_t before = __shfl_up_sync(~0u, key, 1);
    is_first_ = lane == 0 || before != key;
    const unsigned later = __ballot_sync(~0u, is_first_) >> lane >> 1;
    left_ = later == 0 ? 32 - lane : unsigned(__ffs(int(later)));
  }
  [[nodiscard]] __device__ bool is_first() const { return is_first_; }
  /// Over this lane and those behind it; the first has the sum of all.
  [[nodiscard]] __device__ float sum(float value) const {
#pragma unroll
    for (unsigned offset = 1; offset < 32; offset *= 2) {
      const float behind = __shfl_down_sync(~0u, value, offset);
      if (offset < left_) value += behind;
    }
    return value;
  }

 private:
  bool is_first_;
  unsigned left_;  // lanes, this one included
};

}  // namespace cnerf
