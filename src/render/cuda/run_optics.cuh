#pragma once
/// Light along a ray, as many samples at a time as lanes share the ray.

#include "src/base/cuda/warp.cuh"
#include "src/render/composite_math.h"

namespace cnerf {

/// Optical depths of a run of samples, one per lane, and with them the light that comes through.
template <int kLanes = 32>
struct RunOptics {
  float depth;          ///< sigma dt of this lane's sample; 0 where there is none
  float depth_through;  ///< of everything up to and including it

  __device__ RunOptics(float depth_before, float own)
      : depth(own), depth_through(depth_before + warp_prefix_sum<kLanes>(own)) {}
  [[nodiscard]] __device__ float transmittance_after() const { return expf(-depth_through); }
  [[nodiscard]] __device__ float weight() const { return expf(depth - depth_through) * alpha_of(depth, 1.0f); }
  /// Up to and including the sample of one lane of the group.
  [[nodiscard]] __device__ float depth_at(int lane) const { return __shfl_sync(~0u, depth_through, lane, kLanes); }
};

}  // namespace cnerf
