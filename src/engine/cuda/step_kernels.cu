#include "src/engine/cuda/step_kernels.h"

#include "src/base/cuda/launch.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/cuda/field_forward.cuh"

namespace cnerf {
namespace {

constexpr unsigned kThreads = 128;

__global__ void begin(StepState* state, const float* learning_rates) {
  const float rate = learning_rates[state->step % kStepRing];
  state->next_ray = state->samples = 0;
  state->loss = state->squared_error = 0;
  state->adam = AdamStep(rate, state->step + 1);
}

/// The views in device memory.
struct DeviceViews {
  const ViewRecord* views;
  std::uint32_t n_views;

  [[nodiscard]] __device__ std::uint32_t count() const { return n_views; }
  [[nodiscard]] __device__ ImageSize size_of(std::uint32_t v) const { return {views[v].width, views[v].height}; }
  [[nodiscard]] __device__ const UnitCamera& camera(std::uint32_t v) const { return views[v].camera; }
  [[nodiscard]] __device__ bool is_valid(std::uint32_t v, std::size_t pixel) const {
    return views[v].mask == nullptr || views[v].mask[pixel] != 0;
  }
  [[nodiscard]] __device__ float coverage(std::uint32_t v, std::size_t pixel) const {
    return views[v].alpha == nullptr ? 1.0f : float(views[v].alpha[pixel]) / 255.0f;
  }
  [[nodiscard]] __device__ float luminance(std::uint32_t v, std::size_t pixel) const {
    const ViewRecord& view = views[v];
    switch (view.depth) {
      case PixelDepth::kU8:
        return view.decoded[static_cast<const std::uint8_t*>(view.pixels)[pixel]];
      case PixelDepth::kU16:
        return view.decoded[static_cast<const std::uint16_t*>(view.pixels)[pixel]];
      default:
        return static_cast<const float*>(view.pixels)[pixel];
    }
  }
};

/// Where the ray is inside the unit cube.
__device__ void clip(RayRecord& record) {
  const auto inside = intersect(Aabbf{{0, 0, 0}, {1, 1, 1}}, record.ray.origin, record.ray.direction);
  if (!inside) return;
  record.begin = inside->begin;
  record.end = inside->end;
}

__global__ void draw(const DrawJob job) {
  const std::uint32_t ray = blockIdx.x * kThreads + threadIdx.x;
  if (ray >= job.state->rays) return;
  const ObservedRay observed =
      observe_ray(DeviceViews{job.views, job.n_views}, job.seed, std::uint64_t(job.state->step), std::uint64_t(ray));
  RayRecord record;
  record.ray = observed.ray;
  record.jitter = observed.jitter;
  record.target = observed.target;
  clip(record);
  job.rays[ray] = record;
  job.directions[ray] = encode_direction(record.ray.direction);
}

__global__ void prepare(const Ray* rays, std::uint32_t count, RayRecord* records, DirectionCode* directions) {
  const std::uint32_t ray = blockIdx.x * kThreads + threadIdx.x;
  if (ray >= count) return;
  RayRecord record;
  record.ray = rays[ray];
  clip(record);
  records[ray] = record;
  directions[ray] = encode_direction(record.ray.direction);
}

__global__ void of_camera(const __grid_constant__ UnitCamera camera, std::uint32_t count, RayRecord* records,
                          DirectionCode* directions) {
  const std::uint32_t ray = blockIdx.x * kThreads + threadIdx.x;
  if (ray >= count) return;
  const auto width = std::uint32_t(camera.intrinsics.width);
  RayRecord record;
  record.ray = camera.ray({ray % width + 0.5, ray / width + 0.5});
  clip(record);
  records[ray] = record;
  directions[ray] = encode_direction(record.ray.direction);
}

__global__ void end(StepState* state, std::uint32_t wanted_samples, std::uint32_t capacity, StepRecord* reports) {
  const double rays = state->rays;
  reports[state->step % kStepRing] = {state->loss / rays, state->squared_error / rays, state->rays,
                                      min(state->samples, capacity)};
  state->rays = std::uint32_t(next_rays(state->rays, state->samples, wanted_samples));
  state->step += 1;
}

}  // namespace

void begin_step(StepState* state, const float* learning_rates, cudaStream_t stream) {
  begin<<<1, 1, 0, stream>>>(state, learning_rates);
  CNERF_CUDA(cudaGetLastError());
}

void draw_training_rays(const DrawJob& job, cudaStream_t stream) {
  draw<<<blocks_for(kMostRays, kThreads), kThreads, 0, stream>>>(job);
  CNERF_CUDA(cudaGetLastError());
}

void prepare_rays(const Ray* rays, std::uint32_t count, RayRecord* records, DirectionCode* directions,
                  cudaStream_t stream) {
  prepare<<<blocks_for(count, kThreads), kThreads, 0, stream>>>(rays, count, records, directions);
  CNERF_CUDA(cudaGetLastError());
}

void camera_rays(const UnitCamera& camera, std::uint32_t count, RayRecord* records, DirectionCode* directions,
                 cudaStream_t stream) {
  of_camera<<<blocks_for(count, kThreads), kThreads, 0, stream>>>(camera, count, records, directions);
  CNERF_CUDA(cudaGetLastError());
}

void end_step(StepState* state, std::uint32_t wanted_samples, std::uint32_t capacity, StepRecord* reports,
              cudaStream_t stream) {
  end<<<1, 1, 0, stream>>>(state, wanted_samples, capacity, reports);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
