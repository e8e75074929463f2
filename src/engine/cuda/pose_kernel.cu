#include "src/engine/cuda/pose_kernel.h"

#include <cuda_bf16.h>

#include "encoding/cuda/hash_grid_device.cuh"
#include "src/base/cuda/launch.h"
#include "src/base/cuda/warp.cuh"

namespace cnerf {
namespace {

constexpr unsigned kThreads = 256;
constexpr std::uint32_t kNobody = ~0u;

/// The gradient of the loss by a sample's position.
__device__ Vec3f by_position(const GridLevels& levels, const uint2* table, const uint2* d_encoded, std::uint32_t most,
                             std::uint32_t sample, const float position[3]) {
  float gradient[3] = {};
  for (int l = 0; l < levels.count; ++l) {
    const uint2 d = __ldg(d_encoded + std::size_t(l) * most + sample);
    const float2 low = __bfloat1622float2(*reinterpret_cast<const __nv_bfloat162*>(&d.x));
    const float2 high = __bfloat1622float2(*reinterpret_cast<const __nv_bfloat162*>(&d.y));
    add_position_gradient(levels.level[l], table, position, make_float4(low.x, low.y, high.x, high.y), gradient);
  }
  return {gradient[0], gradient[1], gradient[2]};
}

/// All lanes together; those of a ray follow one another.
/// @param key  the ray's number; kNobody where it is not asked
__device__ void teach_lens(const PoseJob& job, std::uint32_t key, std::uint32_t view, const Vec3f& by_direction) {
  const WarpSegment segment(key);
  const Vec3f sum = {segment.sum(by_direction.x), segment.sum(by_direction.y), segment.sum(by_direction.z)};
  if (key == kNobody || !segment.is_first()) return;
  const ViewRecord& record = job.views[view];
  LensGradient gradient;
  add_lens_gradient(record.camera, record.given, job.learned.corrections[view].turn, job.rays[key].ray.direction, sum,
                    gradient);
  for (int i = 0; i < kLensNumbers; ++i) {
    atomicAdd(&job.learned.lens_gradients[record.lens].by[i], gradient.by[i]);
  }
}

/// A lane per sample. Samples of a ray follow one another, so that what they add is summed before it is written.
__global__ void __launch_bounds__(kThreads)
    teach_cameras(const __grid_constant__ GridLevels levels, const uint2* __restrict__ table,
                  const uint2* __restrict__ d_encoded, const PoseJob job) {
  const unsigned lane = threadIdx.x % 32;
  const std::uint32_t n = min(*job.count.count, job.count.most);
  for (std::uint32_t first = blockIdx.x * kThreads + threadIdx.x - lane; first < n; first += gridDim.x * kThreads) {
    const std::uint32_t sample = first + lane;
    const float4 place = __ldg(job.places + min(sample, n - 1));
    const std::uint32_t ray = __float_as_uint(place.w);
    const bool teaches = sample < n && job.learned.learning.teaches_camera(ray);
    if (!__any_sync(~0u, teaches)) continue;
    ViewGradient gradient;
    Vec3f by_direction;
    std::uint32_t view = kNobody;
    if (teaches) {
      const float position[3] = {place.x, place.y, place.z};
      view = job.rays[ray].view;
      const Vec3f arm = Vec3f{place.x, place.y, place.z} - job.rays[ray].ray.origin;
      const Vec3f by_point = by_position(levels, table, d_encoded, job.count.most, sample, position);
      gradient.add(arm, by_point);
      by_direction = length(arm) * by_point;
    }
    const WarpSegment segment(view);
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      const float turn = segment.sum(gradient.by_rotation[axis]);
      const float shift = segment.sum(gradient.by_shift[axis]);
      if (view == kNobody || !segment.is_first()) continue;
      atomicAdd(&job.learned.gradients[view].by_rotation[axis], turn);
      atomicAdd(&job.learned.gradients[view].by_shift[axis], shift);
    }
    const bool teaches_the_lens = teaches && job.learned.learning.teaches_lens(ray);
    if (__any_sync(~0u, teaches_the_lens)) teach_lens(job, teaches_the_lens ? ray : kNobody, view, by_direction);
  }
}

}  // namespace

void add_camera_gradients(const PositionSlopes& slopes, const PoseJob& job, cudaStream_t stream) {
  constexpr int kBlocksEach = 4;
  const GridLevels levels(slopes.levels.data(), slopes.levels.size());
  teach_cameras<<<unsigned(multiprocessors() * kBlocksEach), kThreads, 0, stream>>>(levels, slopes.table,
                                                                                    slopes.d_encoded, job);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
