#include "bake/visibility/cuda/sight_kernel.h"
#include "src/base/cuda/device_memory.h"

namespace cnerf::bake {
namespace {

constexpr unsigned kThreads = 128;

/// A thread a point. Neighbours in a warp are of one brick: they try the same cameras along nearly the same way.
__global__ void find_seeing_kernel(SightJob job) {
  const std::uint32_t i = blockIdx.x * kThreads + threadIdx.x;
  if (i >= job.count) return;
  const Sight sight = job.sights[i];
  job.counts[i] = find_seeing(job.scene, job.level, sight, job.orders + std::size_t(sight.order) * job.scene.eye_count,
                              job.seen + std::size_t(i) * job.scene.views);
}

}  // namespace

void find_seeing_all(const SightJob& job, cudaStream_t stream) {
  if (job.count == 0) return;
  find_seeing_kernel<<<(job.count + kThreads - 1) / kThreads, kThreads, 0, stream>>>(job);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf::bake
