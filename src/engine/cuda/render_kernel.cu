#include "src/engine/cuda/trace_kernel.h"

#include "src/base/cuda/device_memory.h"
#include "src/base/cuda/launch.h"
#include "src/field/cuda/channel_tiles.h"
#include "src/field/cuda/field_forward.cuh"
#include "src/render/cuda/run_optics.cuh"
#include "src/render/cuda/warp_march.cuh"

namespace cnerf {
namespace {

constexpr int kWarps = 8;
constexpr int kThreads = 32 * kWarps;

/// A warp follows two rays, a tile of 16 samples of each at a time. Rays of a picture end after a dozen or two: with 32
/// samples at a time more would be evaluated behind the last.
constexpr int kLanes = 16;
constexpr int kRaysOfWarp = 32 / kLanes;
static_assert(kRaysOfWarp == kWarpTiles, "a tile has one ray's direction");

/// A tile whose samples add less than this to the opacity is left dark, if that of the other ray is as well: a tenth of
/// an 8-bit step in light.
constexpr float kLeastSeen = 4e-4f;

template <int KT>
struct RenderShared {
  BlockField<KT, kWarps> field;
  MarchQueue queue[kWarps];
};

/// The ray of this lane's half of the warp.
struct HalfWarpRay {
  bool is_open = false;
  std::uint32_t index = 0;
  Ray ray;
  WarpMarcher<kLanes> marcher;
  float depth = 0;                      ///< optical, so far
  float luminance = 0, weighted_t = 0;  ///< this lane's share

  __device__ void start(std::uint32_t number, const RayRecord& record, const OccupiedSpace& space,
                        const MarchSettings& march) {
    is_open = true;
    index = number;
    ray = record.ray;
    marcher = {space, march, record};
    depth = luminance = weighted_t = 0;
  }
};

/// Writes the rays of the halves that have one and for which `ends`; those are free for others then. What is left of a
/// ray that became opaque is taken to look like what was seen of it.
__device__ void finish(HalfWarpRay& open_ray, bool ends, bool is_opaque, RayResult* results) {
  ends = ends && open_ray.is_open;
  const float luminance = warp_sum<kLanes>(open_ray.luminance), weighted_t = warp_sum<kLanes>(open_ray.weighted_t);
  if (!ends) return;
  const float weight = 1.0f - expf(-open_ray.depth);
  if (threadIdx.x % kLanes == 0) {
    results[open_ray.index] = {is_opaque ? luminance / weight : luminance, is_opaque ? 1.0f : weight,
                               weight > 0 ? weighted_t / weight : 0.0f};
  }
  open_ray.is_open = false;
}

template <int KT>
__global__ void __launch_bounds__(kThreads, 2)
    render(const __grid_constant__ GridLevels levels, const __grid_constant__ TraceJob job) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<RenderShared<KT>*>(memory);
  shared.field.load(job.field.nets);
  const unsigned lane = threadIdx.x % 32, group = lane / kLanes;
  WarpField<KT>& warp = shared.field.warp[threadIdx.x / 32];
  MarchQueue& queue = shared.queue[threadIdx.x / 32];
  const FieldNets<KT> nets(shared.field.weights, shared.field.last_layer);
  const OccupiedSpace space = {job.layout, job.occupied};

  // Neighbouring pixels go to one multiprocessor at about the same time: they look up the same cells.
  const std::uint32_t n_rays = job.state->rays, stride = gridDim.x * kWarps * kRaysOfWarp;
  std::uint32_t next = (blockIdx.x * kWarps + threadIdx.x / 32) * kRaysOfWarp + group;
  HalfWarpRay open_ray;
  RaySample sample;
  bool is_done = false;
  while (true) {
    int count = 0;
    while (__any_sync(~0u, count == 0 && !is_done)) {
      if (!open_ray.is_open && !is_done) {
        is_done = next >= n_rays;
        if (!is_done) open_ray.start(next, job.rays[next], space, job.march);
        next += stride;
      }
      const bool wants = count == 0 && open_ray.is_open;
      const int found = open_ray.marcher.next(sample, queue, wants);
      if (wants) count = found;
      finish(open_ray, count == 0, false, job.results);
    }
    if (!__any_sync(~0u, open_ray.is_open)) break;

    uint2 directions[kRaysOfWarp];
#pragma unroll
    for (int r = 0; r < kRaysOfWarp; ++r) {
      directions[r] = share_of_lane(job.directions[__shfl_sync(~0u, open_ray.index, r * kLanes)]);
    }
    warp.encode(levels, job.field.table, in_box(open_ray.ray.at(sample.t)), lane);
    __syncwarp();
    typename FieldNets<KT>::Geometry geometry;
    const float depth = density_from_raw(nets.density(warp, geometry), job.field.density_scale) * sample.dt;
    const bool is_sample = int(lane % kLanes) < count;
    const RunOptics<kLanes> optics(open_ray.depth, is_sample ? depth : 0.0f);
    const unsigned opaque = warp_ballot<kLanes>(optics.transmittance_after() < job.min_transmittance);
    const bool ends = opaque != 0 && __ffs(opaque) <= count;
    if (ends) count = __ffs(opaque);  // the sample at which the ray becomes opaque is the last one
    const float weight = int(lane % kLanes) < count ? optics.weight() : 0.0f;
    const bool is_seen = __any_sync(~0u, warp_sum<kLanes>(weight) > kLeastSeen);
    if (is_seen) {
      open_ray.luminance += weight * job.field.activation.value(nets.luminance(warp, geometry, directions));
    }
    open_ray.weighted_t += weight * sample.t;
    const float through = optics.depth_at(max(count, 1) - 1);
    if (count > 0) open_ray.depth = through;
    finish(open_ray, ends, true, job.results);
    __syncwarp();
  }
}

}  // namespace

void render_rays(const TraceJob& job, cudaStream_t stream) {
  with_channel_tiles(job.field.n_levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    using Shared = RenderShared<KT>;
    const unsigned blocks = resident_blocks<render<KT>>(kThreads, sizeof(Shared));
    render<KT><<<blocks, kThreads, sizeof(Shared), stream>>>(GridLevels(job.field.levels, job.field.n_levels), job);
    CNERF_CUDA(cudaGetLastError());
  });
}

}  // namespace cnerf
