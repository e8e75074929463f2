#include "src/engine/cuda/step_kernels.h"

#include "src/base/cuda/launch.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/cuda/field_forward.cuh"

namespace cnerf {
namespace {

constexpr unsigned kThreads = 128;

__global__ void begin(StepState* state, const float* learning_rates, const StepPart part) {
  const float rate = learning_rates[state->step % kStepRing];
  const auto [first, last] = part_of_rays(state->rays, part.part, part.parts);
  state->first_ray = state->next_ray = first;
  state->end_ray = last;
  state->samples = 0;
  state->loss = state->squared_error = 0;
  state->adam = AdamStep(rate, state->step + 1);
}

/// The views in device memory; of those that pixels are drawn from, what `observe_ray` numbers.
struct DeviceViews {
  const ViewRecord* views;
  const ViewCorrection* corrections;
  std::uint32_t n_views;
  const std::uint32_t* resident;

  [[nodiscard]] __device__ std::uint32_t number_of(std::uint32_t v) const {
    return resident == nullptr ? v : resident[v];
  }
  [[nodiscard]] __device__ const ViewRecord& view(std::uint32_t v) const { return views[number_of(v)]; }
  [[nodiscard]] __device__ std::uint32_t count() const { return n_views; }
  [[nodiscard]] __device__ ViewCorrection correction(std::uint32_t v) const {
    return corrections == nullptr ? ViewCorrection() : corrections[number_of(v)];
  }
  [[nodiscard]] __device__ ImageSize size_of(std::uint32_t v) const { return {view(v).width, view(v).height}; }
  [[nodiscard]] __device__ const UnitCamera& camera(std::uint32_t v) const { return view(v).camera; }
  [[nodiscard]] __device__ bool is_valid(std::uint32_t v, std::size_t pixel) const {
    return view(v).mask == nullptr || view(v).mask[pixel] != 0;
  }
  [[nodiscard]] __device__ float coverage(std::uint32_t v, std::size_t pixel) const {
    return view(v).alpha == nullptr ? 1.0f : float(view(v).alpha[pixel]) / 255.0f;
  }
  [[nodiscard]] __device__ SkyLabel sky_label(std::uint32_t v, std::size_t pixel) const {
    return view(v).sky_labels == nullptr ? SkyLabel::kScene : view(v).sky_labels[pixel];
  }
  [[nodiscard]] __device__ DepthHint depth(std::uint32_t v, int x, int y) const {
    const ViewRecord& record = view(v);
    if (record.depths == nullptr) return {};
    const int column = hint_cell(x, record.width, record.depth_columns),
              row = hint_cell(y, record.height, record.depth_rows);
    return record.depths[row * record.depth_columns + column];
  }
  [[nodiscard]] __device__ DirectionView sky(std::uint32_t v) const { return view(v).sky; }
  [[nodiscard]] __device__ float luminance(std::uint32_t v, std::size_t pixel) const {
    const ViewRecord& record = view(v);
    switch (record.depth) {
      case PixelDepth::kU8:
        return record.decoded[static_cast<const std::uint8_t*>(record.pixels)[pixel]];
      case PixelDepth::kU16:
        return record.decoded[static_cast<const std::uint16_t*>(record.pixels)[pixel]];
      default:
        return static_cast<const float*>(record.pixels)[pixel];
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
  const std::uint32_t ray = job.state->first_ray + blockIdx.x * kThreads + threadIdx.x;
  if (ray >= job.state->end_ray) return;
  const DeviceViews views = {job.views, job.corrections, job.n_views, job.resident};
  const ObservedRay observed = observe_ray(views, job.seed, std::uint64_t(job.state->step), std::uint64_t(ray));
  RayRecord record;
  record.ray = observed.ray;
  record.jitter = observed.jitter;
  record.target = observed.target;
  record.view = views.number_of(observed.view);
  if (job.depth.weight_at(job.state->step) <= 0) record.target.depth = {};  // so that no sample is compared
  clip(record);
  job.rays[ray] = record;
  job.directions[ray] = encode_direction(record.ray.direction);
}

__global__ void place(const PlacedView placed, ViewRecord* views, std::uint32_t* resident) {
  ViewRecord& record = views[placed.view];
  record.pixels = placed.pixels;
  record.alpha = placed.alpha;
  record.mask = placed.mask;
  record.sky_labels = placed.sky_labels;
  *resident = placed.view;
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

constexpr unsigned kGaugeThreads = 256;

__device__ void put_lenses(const LearnedViews& learned, ViewRecord* views) {
  for (int v = int(threadIdx.x); v < learned.learning.views; v += kGaugeThreads) {
    views[v].camera.intrinsics = learned.lenses[views[v].lens].applied_to(views[v].given);
  }
}

/// A thread per lens, then a thread per view.
__device__ void update_lenses(const LearnedViews& learned, ViewRecord* views, const AdamStep& adam, long step) {
  if (learned.learning.lenses == 0) return;
  for (int l = int(threadIdx.x); l < learned.learning.lenses; l += kGaugeThreads) {
    int first = 0;
    while (views[first].lens != l) ++first;  // every lens has a view
    update_lens(learned.learning.of_cameras(adam, learned.learning.lens_rate, step), views[first].given,
                learned.lens_gradients[l], learned.lens_moments[l], learned.lenses[l]);
    learned.lens_gradients[l] = {};
  }
  __syncthreads();
  put_lenses(learned, views);
}

__global__ void __launch_bounds__(kGaugeThreads) set_lenses(const LearnedViews learned, ViewRecord* views) {
  put_lenses(learned, views);
}

/// One block.
__global__ void __launch_bounds__(kGaugeThreads)
    update_views(const LearnedViews learned, ViewRecord* views, const StepState* state) {
  const long step = long(state->step) + 1;
  const int n = learned.learning.views;
  for (int v = int(threadIdx.x); v < n; v += kGaugeThreads) {
    update_view(learned.learning, state->adam, step, learned.gradients[v], learned.moments[v], learned.corrections[v]);
    learned.gradients[v] = {};
  }
  update_lenses(learned, views, state->adam, step);
  if (step % kGaugeEvery != 0) return;
  alignas(ViewGauge) __shared__ unsigned char memory[sizeof(ViewGauge)];
  auto& gauge = *reinterpret_cast<ViewGauge*>(memory);
  const auto origin = [&](int v) { return views[v].camera.origin.cast<float>(); };
  __syncthreads();
  if (threadIdx.x == 0) gauge = pose_gauge(learned.corrections, n, origin);
  __syncthreads();
  for (int v = int(threadIdx.x); v < n; v += kGaugeThreads) {
    if (is_median_gain(learned.corrections, n, v)) gauge.log_gain = learned.corrections[v].log_gain;
  }
  __syncthreads();
  for (int v = int(threadIdx.x); v < n; v += kGaugeThreads) gauge.take_off(origin(v), learned.corrections[v]);
}

constexpr std::uint32_t kHalf = 1u << 12;  // counts travel in two floats, so that sums below 2^36 are exact

__global__ void pack_sums(const StepState* state, float* sums) {
  sums[0] = float(state->loss);
  sums[1] = float(state->squared_error);
  sums[2] = float(state->samples / kHalf);
  sums[3] = float(state->samples % kHalf);
}

__global__ void unpack_sums(const float* sums, StepState* state) {
  state->loss = sums[0];
  state->squared_error = sums[1];
  state->samples = std::uint32_t(sums[2]) * kHalf + std::uint32_t(sums[3]);
}

__global__ void end(StepState* state, std::uint32_t wanted_samples, std::uint32_t capacity, StepRecord* reports) {
  const double rays = state->rays;
  reports[state->step % kStepRing] = {state->loss / rays, state->squared_error / rays, state->rays,
                                      min(state->samples, capacity)};
  state->rays = std::uint32_t(next_rays(state->rays, state->samples, wanted_samples));
  state->step += 1;
}

}  // namespace

void begin_step(StepState* state, const float* learning_rates, const StepPart& part, cudaStream_t stream) {
  begin<<<1, 1, 0, stream>>>(state, learning_rates, part);
  CNERF_CUDA(cudaGetLastError());
}

void draw_training_rays(const DrawJob& job, cudaStream_t stream) {
  draw<<<blocks_for(kMostRays, kThreads), kThreads, 0, stream>>>(job);
  CNERF_CUDA(cudaGetLastError());
}

void put_view(const PlacedView& placed, ViewRecord* views, std::uint32_t* resident, cudaStream_t stream) {
  place<<<1, 1, 0, stream>>>(placed, views, resident);
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

void use_lenses(const LearnedViews& learned, ViewRecord* views, cudaStream_t stream) {
  if (learned.learning.lenses == 0 || views == nullptr) return;
  set_lenses<<<1, kGaugeThreads, 0, stream>>>(learned, views);
  CNERF_CUDA(cudaGetLastError());
}

void update_corrections(const LearnedViews& learned, ViewRecord* views, const StepState* state, cudaStream_t stream) {
  update_views<<<1, kGaugeThreads, 0, stream>>>(learned, views, state);
  CNERF_CUDA(cudaGetLastError());
}

void pack_step_sums(const StepState* state, float* sums, cudaStream_t stream) {
  pack_sums<<<1, 1, 0, stream>>>(state, sums);
  CNERF_CUDA(cudaGetLastError());
}

void unpack_step_sums(const float* sums, StepState* state, cudaStream_t stream) {
  unpack_sums<<<1, 1, 0, stream>>>(sums, state);
  CNERF_CUDA(cudaGetLastError());
}

void end_step(StepState* state, std::uint32_t wanted_samples, std::uint32_t capacity, StepRecord* reports,
              cudaStream_t stream) {
  end<<<1, 1, 0, stream>>>(state, wanted_samples, capacity, reports);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
