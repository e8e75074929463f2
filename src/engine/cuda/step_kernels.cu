#include "src/engine/cuda/step_kernels.h"

#include "src/base/cuda/device_memory.h"
#include "src/capture/camera_math.h"
#include "src/color/colorspace_math.h"
#include "src/field/cuda/field_forward.cuh"

namespace cnerf {
namespace {

constexpr unsigned kThreads = 128;

unsigned blocks_for(std::size_t items) {
  return unsigned((items + kThreads - 1) / kThreads);
}

__global__ void begin(StepState* state, const float* learning_rates) {
  const float rate = learning_rates[state->step % kStepRing];
  state->next_ray = state->samples = state->dropped = 0;
  state->loss = state->squared_error = 0;
  state->marched = 0;
  state->adam = AdamStep(AdamSettings{}, rate, state->step + 1);
}

__device__ float luminance_of(const ViewRecord& view, std::size_t pixel) {
  switch (view.depth) {
    case PixelDepth::kU8:
      return view.decoded[static_cast<const std::uint8_t*>(view.pixels)[pixel]];
    case PixelDepth::kU16:
      return view.decoded[static_cast<const std::uint16_t*>(view.pixels)[pixel]];
    default:
      return static_cast<const float*>(view.pixels)[pixel];
  }
}

__device__ Ray pixel_ray(const UnitCamera& camera, double x, double y) {
  return {camera.origin.cast<float>(),
          normalized(camera.unit_from_camera * lens::ray_direction(camera.intrinsics, {x, y})).cast<float>()};
}

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
  const auto step = std::uint64_t(job.state->step);
  const auto size_of = [&](std::uint32_t v) { return ImageSize{job.views[v].width, job.views[v].height}; };
  PickedPixel picked;
  std::size_t pixel = 0;
  for (int attempt = 0; attempt < kPickAttempts; ++attempt) {
    picked = pick_pixel(job.n_views, size_of, job.sampling, job.seed, step, ray, attempt);
    pixel = std::size_t(picked.y) * std::size_t(job.views[picked.view].width) + std::size_t(picked.x);
    if (job.views[picked.view].mask == nullptr || job.views[picked.view].mask[pixel] != 0) break;
  }
  const ViewRecord& view = job.views[picked.view];
  const CounterRng rng = ray_rng(job.seed, step);
  RayRecord record;
  record.ray = pixel_ray(view.camera, picked.x + 0.5, picked.y + 0.5);
  record.jitter = rng.uniform(2 * std::uint64_t(ray));
  record.target = luminance_of(view, pixel);
  if (view.alpha != nullptr) record.coverage = float(view.alpha[pixel]) / 255.0f;
  record.background = luminance_from_lightness(100.0f * rng.uniform(2 * std::uint64_t(ray) + 1));
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

__global__ void of_camera(const __grid_constant__ UnitCamera camera, std::uint32_t first, std::uint32_t count,
                          RayRecord* records, DirectionCode* directions) {
  const std::uint32_t ray = blockIdx.x * kThreads + threadIdx.x;
  if (ray >= count) return;
  const auto width = std::uint32_t(camera.intrinsics.width);
  RayRecord record;
  record.ray = pixel_ray(camera, (first + ray) % width + 0.5, (first + ray) / width + 0.5);
  clip(record);
  records[ray] = record;
  directions[ray] = encode_direction(record.ray.direction);
}

__global__ void adam_rows(const AdamStep* adam, std::uint32_t rows, float decay, float4* __restrict__ table,
                          float4* __restrict__ d_table, float4* __restrict__ moments, uint2* __restrict__ halves) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row >= rows) return;
  const float4 d = d_table[row];
  if (d.x == 0 && d.y == 0 && d.z == 0 && d.w == 0) return;
  const AdamStep step = *adam;
  float4 value = table[row], first = moments[2 * std::size_t(row)], second = moments[2 * std::size_t(row) + 1];
  const AdamSettings settings;
  const float kept = 1 - step.learning_rate * decay;
  value = make_float4(kept * value.x, kept * value.y, kept * value.z, kept * value.w);
  step.apply(settings, d.x, first.x, second.x, value.x);
  step.apply(settings, d.y, first.y, second.y, value.y);
  step.apply(settings, d.z, first.z, second.z, value.z);
  step.apply(settings, d.w, first.w, second.w, value.w);
  table[row] = value;
  moments[2 * std::size_t(row)] = first;
  moments[2 * std::size_t(row) + 1] = second;
  d_table[row] = make_float4(0, 0, 0, 0);
  halves[row] = halves_of(value);
}

__global__ void round_rows(std::uint32_t rows, const float4* table, uint2* halves) {
  const std::uint32_t row = blockIdx.x * kThreads + threadIdx.x;
  if (row < rows) halves[row] = halves_of(table[row]);
}

__global__ void end(StepState* state, std::uint32_t wanted_samples, std::uint32_t capacity, std::uint32_t most_rays,
                    StepRecord* reports) {
  const std::uint32_t trained = min(state->samples, capacity);
  const double rays = state->rays;
  reports[state->step % kStepRing] = {
      state->loss / rays, state->squared_error / rays, state->rays, state->marched, trained, state->dropped};
  const double fill = double(wanted_samples) / double(max(state->samples, 64u));
  const auto next = std::int64_t(rays * (fill < 0.5 ? 0.5 : fill > 2.0 ? 2.0 : fill)) / 16 * 16;
  state->rays = std::uint32_t(next < 64 ? 64 : next > most_rays ? most_rays : next);
  state->step += 1;
}

}  // namespace

void begin_step(StepState* state, const float* learning_rates, cudaStream_t stream) {
  begin<<<1, 1, 0, stream>>>(state, learning_rates);
  CNERF_CUDA(cudaGetLastError());
}

void draw_training_rays(const DrawJob& job, std::uint32_t most_rays, cudaStream_t stream) {
  draw<<<blocks_for(most_rays), kThreads, 0, stream>>>(job);
  CNERF_CUDA(cudaGetLastError());
}

void prepare_rays(const Ray* rays, std::uint32_t count, RayRecord* records, DirectionCode* directions,
                  cudaStream_t stream) {
  prepare<<<blocks_for(count), kThreads, 0, stream>>>(rays, count, records, directions);
  CNERF_CUDA(cudaGetLastError());
}

void camera_rays(const UnitCamera& camera, std::uint32_t first, std::uint32_t count, RayRecord* records,
                 DirectionCode* directions, cudaStream_t stream) {
  of_camera<<<blocks_for(count), kThreads, 0, stream>>>(camera, first, count, records, directions);
  CNERF_CUDA(cudaGetLastError());
}

void update_table(const AdamStep* adam, std::uint32_t rows, float decay, float4* table, float4* d_table,
                  float4* moments, uint2* halves, cudaStream_t stream) {
  adam_rows<<<blocks_for(rows), kThreads, 0, stream>>>(adam, rows, decay, table, d_table, moments, halves);
  CNERF_CUDA(cudaGetLastError());
}

void round_table(std::uint32_t rows, const float4* table, uint2* halves, cudaStream_t stream) {
  round_rows<<<blocks_for(rows), kThreads, 0, stream>>>(rows, table, halves);
  CNERF_CUDA(cudaGetLastError());
}

void end_step(StepState* state, std::uint32_t wanted_samples, std::uint32_t capacity, std::uint32_t most_rays,
              StepRecord* reports, cudaStream_t stream) {
  end<<<1, 1, 0, stream>>>(state, wanted_samples, capacity, most_rays, reports);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
