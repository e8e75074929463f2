#include "src/engine/cuda/trace_kernel.h"

#include "src/base/cuda/device_memory.h"
#include "src/base/cuda/launch.h"
#include "src/base/cuda/warp.cuh"
#include "src/field/cuda/channel_tiles.h"
#include "src/field/cuda/field_forward.cuh"
#include "src/render/cuda/run_optics.cuh"
#include "src/render/cuda/warp_march.cuh"

namespace cnerf {
namespace {

constexpr int kWarps = 8;
constexpr int kThreads = 32 * kWarps;

enum class Keep { kTraining, kSamples };

template <int KT>
struct TraceShared {
  BlockField<KT, kWarps> field;
  MarchQueue queue[kWarps];
};

/// What a ray has gathered so far; of a training ray, lane r knows where run r begins.
struct RayProgress {
  float depth = 0;  ///< optical
  int samples = 0;
  std::uint32_t run_begin = 0;
  bool has_room = true;
};

/// Takes memory for a run's samples; false when there is none left.
__device__ bool allocate_run(RayProgress& ray, int count, std::uint32_t capacity, std::uint32_t* allocated) {
  const unsigned lane = threadIdx.x % 32;
  std::uint32_t begin = 0;
  if (lane == 0) begin = atomicAdd(allocated, std::uint32_t(count));
  begin = __shfl_sync(~0u, begin, 0);
  if (int(lane) == ray.samples / 32) ray.run_begin = begin;
  return begin + std::uint32_t(count) <= capacity;
}

/// What a lane found at its sample.
struct FoundSample {
  Vec3f place;
  float depth, raw_luminance;
};

/// Keeps a run of `count` samples, one per lane, for the backward pass.
template <int KT>
__device__ void keep_for_training(const TraceJob& job, const WarpField<KT>& warp, std::uint32_t ray_index,
                                  const FoundSample& found, int count, RayProgress& ray) {
  const unsigned lane = threadIdx.x % 32;
  const SampleArrays& samples = job.samples;
  ray.has_room = allocate_run(ray, count, samples.capacity, &job.state->samples);
  const std::uint32_t begin = __shfl_sync(~0u, ray.run_begin, ray.samples / 32);
  if (int(lane) < count && begin + lane < samples.capacity) {
    const Vec3f place = found.place;
    samples.places[begin + lane] = make_float4(place.x, place.y, place.z, __uint_as_float(ray_index));
    samples.gradients[begin + lane] = make_float2(found.depth, found.raw_luminance);
  }
  const std::uint32_t room = samples.capacity - min(begin, samples.capacity);
  warp.store(samples.encoded + std::size_t(begin) * (2 * KT), unsigned(count), room, lane);
}

__device__ WeightedSample* scratch_of_warp(const KeptSamples& kept) {
  return kept.scratch + (std::size_t(blockIdx.x) * kWarps + threadIdx.x / 32) * kMostSamplesOfRay;
}

/// Calls `visit(sample)` for this lane's share of a ray's samples.
template <typename Visit>
__device__ void for_samples_of_lane(const WeightedSample* samples, int count, Visit&& visit) {
  for (int s = int(threadIdx.x) % 32; s < count; s += 32) visit(samples[s]);
}

/// The weight of the lightest sample among the fewest that carry `wanted`.
__device__ float lightest_carrying(float wanted, const WeightedSample* samples, int count) {
  std::uint32_t lightest = 0;  // weights are not negative: they have the order of their bits
  for (int bit = 30; bit >= 0; --bit) {
    const std::uint32_t tried = lightest | (1u << bit);
    float carried = 0;
    for_samples_of_lane(samples, count, [&](const WeightedSample& sample) {
      carried += __float_as_uint(sample.weight) >= tried ? sample.weight : 0.0f;
    });
    if (warp_sum(carried) >= wanted) lightest = tried;
  }
  return __uint_as_float(lightest);
}

/// As keep_heaviest (heaviest_samples.h), of a ray whose samples lie in the warp's scratch.
__device__ void keep_heaviest_of_ray(const TraceJob& job, const Ray& ray, std::uint32_t index, int count) {
  const unsigned lane = threadIdx.x % 32;
  const KeptSamples& kept = job.kept;
  const WeightedSample* samples = scratch_of_warp(kept);
  float total = 0;
  for_samples_of_lane(samples, count, [&](const WeightedSample& sample) { total += sample.weight; });
  total = warp_sum(total);
  const bool keeps_all = kept.share >= 1;
  const float lightest = keeps_all || total <= 0 ? 0.0f : lightest_carrying(kept.share * total, samples, count);
  const auto is_kept = [&](float weight) { return keeps_all || (weight >= lightest && weight > 0); };

  int n = 0;
  RayResult sums;  // this lane's share, not yet scaled
  for_samples_of_lane(samples, count, [&](const WeightedSample& sample) {
    if (!is_kept(sample.weight)) return;
    ++n;
    sums.luminance += sample.weight * sample.luminance;
    sums.opacity += sample.weight;
    sums.depth += sample.weight * sample.t;
  });
  sums = {warp_sum(sums.luminance), warp_sum(sums.opacity), warp_sum(sums.depth)};
  n = int(warp_sum(float(n)));
  const float opacity = total > 1 - job.min_transmittance ? 1.0f : total;  // RenderEffort::opacity_of
  const float scale = sums.opacity > 0 ? opacity / sums.opacity : 1.0f;
  std::uint32_t to = 0;
  if (lane == 0) {
    to = atomicAdd(&job.state->samples, std::uint32_t(n));
    kept.begins[index] = to;
    kept.ends[index] = to + std::uint32_t(n);
    const float depth = sums.opacity > 0 ? sums.depth / sums.opacity : 0.0f;
    kept.results[index] = {scale * sums.luminance, scale * sums.opacity, depth};
  }
  to = __shfl_sync(~0u, to, 0);
  if (to + std::uint32_t(n) > kept.capacity) return;
  for (int first = 0; first < count; first += 32) {
    const bool has_sample = first + int(lane) < count;
    const WeightedSample sample = has_sample ? samples[first + lane] : WeightedSample{};
    const unsigned all = __ballot_sync(~0u, has_sample && is_kept(sample.weight));
    if ((all >> lane & 1u) != 0) {
      const std::uint32_t at = to + std::uint32_t(__popc(all & ((1u << lane) - 1u)));
      kept.positions[at] = ray.at(sample.t);
      kept.t[at] = sample.t;
      kept.weights[at] = scale * sample.weight;
      kept.luminance[at] = sample.luminance;
    }
    to += std::uint32_t(__popc(all));
  }
}

__device__ void write_runs(const RayProgress& ray, RayRuns& runs) {
  const int lane = int(threadIdx.x) % 32;
  if (32 * lane < ray.samples) runs.begins[lane] = ray.run_begin;
  if (lane != 0) return;
  runs.samples = ray.samples;
  runs.has_room = ray.has_room;
}

template <int KT, Keep kKeep>
__device__ RayProgress follow_ray(const GridLevels& levels, const TraceJob& job, TraceShared<KT>& shared,
                                  const RayRecord& record, std::uint32_t ray_index) {
  const unsigned lane = threadIdx.x % 32;
  WarpField<KT>& warp = shared.field.warp[threadIdx.x / 32];
  const FieldNets<KT> nets(shared.field.weights, shared.field.last_layer);
  const OccupiedSpace space = {job.layout, job.occupied};
  uint2 directions[kWarpTiles];
  for (uint2& direction : directions) direction = share_of_lane(job.directions[ray_index]);
  WarpMarcher<> marcher(space, job.march, record);

  RayProgress ray;
  RaySample sample;
  bool is_open = true;
  while (is_open && ray.samples < kMostSamplesOfRay) {
    int count = marcher.next(sample, shared.queue[threadIdx.x / 32]);
    if (count == 0) break;
    const Vec3f place = in_box(record.ray.at(sample.t));
    warp.encode(levels, job.field.table, place, lane);
    __syncwarp();
    typename FieldNets<KT>::Geometry geometry;
    const float depth = density_from_raw(nets.density(warp, geometry), job.field.density_scale) * sample.dt;
    const RunOptics<> optics(ray.depth, int(lane) < count ? depth : 0.0f);
    const unsigned opaque = __ballot_sync(~0u, optics.transmittance_after() < job.min_transmittance);
    if (opaque != 0 && __ffs(opaque) <= count) {
      count = __ffs(opaque);  // the sample at which the ray becomes opaque is the last one
      is_open = false;
    }
    const float raw_luminance = nets.luminance(warp, geometry, directions);
    ray.depth = optics.depth_at(count - 1);

    if constexpr (kKeep == Keep::kTraining) {
      keep_for_training(job, warp, ray_index, {place, depth, raw_luminance}, count, ray);
      is_open = is_open && ray.has_room;
    }
    if constexpr (kKeep == Keep::kSamples) {
      if (int(lane) < count) {
        const float luminance = job.field.activation.value(raw_luminance);
        scratch_of_warp(job.kept)[ray.samples + int(lane)] = {sample.t, optics.weight(), luminance};
      }
    }
    ray.samples += count;
    __syncwarp();
  }
  return ray;
}

template <int KT, Keep kKeep>
__global__ void __launch_bounds__(kThreads, 2)
    trace(const __grid_constant__ GridLevels levels, const __grid_constant__ TraceJob job) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<TraceShared<KT>*>(memory);
  shared.field.load(job.field.nets);
  const unsigned lane = threadIdx.x % 32;
  const std::uint32_t end_ray = job.state->end_ray;

  while (true) {
    std::uint32_t index = 0;
    if (lane == 0) index = atomicAdd(&job.state->next_ray, 1u);
    index = __shfl_sync(~0u, index, 0);
    if (index >= end_ray) break;
    const RayRecord record = job.rays[index];
    const RayProgress ray = follow_ray<KT, kKeep>(levels, job, shared, record, index);
    if constexpr (kKeep == Keep::kTraining) write_runs(ray, job.runs[index]);
    if constexpr (kKeep == Keep::kSamples) {
      keep_heaviest_of_ray(job, record.ray, index, ray.samples);
      __syncwarp();  // before the next ray's samples take their place
    }
  }
}

template <int KT>
struct QueryShared {
  BlockField<KT, kWarps> field;
};

template <int KT>
__global__ void __launch_bounds__(kThreads, 2)
    query(const __grid_constant__ GridLevels levels, const FieldView field, const QueryJob job) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<QueryShared<KT>*>(memory);
  shared.field.load(field.nets);
  const unsigned lane = threadIdx.x % 32;
  WarpField<KT>& warp = shared.field.warp[threadIdx.x / 32];
  const FieldNets<KT> nets(shared.field.weights, shared.field.last_layer);
  for (std::uint32_t first = (blockIdx.x * kWarps + threadIdx.x / 32) * 32; first < job.count;
       first += gridDim.x * kThreads) {
    const std::uint32_t i = min(first + lane, job.count - 1);
    warp.encode(levels, field.table, in_box(job.positions[i]), lane);
    if (job.directions != nullptr) warp.set_direction(job.directions[i], lane);
    __syncwarp();
    typename FieldNets<KT>::Geometry geometry;
    const float raw_density = nets.density(warp, geometry);
    const float raw_luminance = job.directions != nullptr ? nets.luminance(warp, geometry, nullptr) : 0.0f;
    if (first + lane < job.count) {
      job.answers[i] = job.directions != nullptr ? field.activation.value(raw_luminance)
                                                 : density_from_raw(raw_density, field.density_scale);
    }
    __syncwarp();
  }
}

template <int KT>
__global__ void __launch_bounds__(kThreads, 2)
    visit_cells(const __grid_constant__ GridLevels levels, const FieldView field, const OccupancyCells cells,
                const OccupancyUpdate update) {
  extern __shared__ uint4 memory[];
  auto& shared = *reinterpret_cast<QueryShared<KT>*>(memory);
  shared.field.load(field.nets);
  const unsigned lane = threadIdx.x % 32;
  WarpField<KT>& warp = shared.field.warp[threadIdx.x / 32];
  const FieldNets<KT> nets(shared.field.weights, shared.field.last_layer);
  const std::size_t count = update.count(cells.count());
  for (std::size_t first = (std::size_t(blockIdx.x) * kWarps + threadIdx.x / 32) * 32; first < count;
       first += std::size_t(gridDim.x) * kThreads) {
    const std::size_t cell = update.cell(min(first + lane, count - 1));
    const float remembered = cells.density[cell];
    if (__all_sync(~0u, remembered == kExcludedCell)) continue;
    warp.encode(levels, field.table, in_box(cells.layout.point_in(cell, update.place_in(cell))), lane);
    __syncwarp();
    typename FieldNets<KT>::Geometry unused;
    const float sigma = density_from_raw(nets.density(warp, unused), field.density_scale);
    if (first + lane < count) cells.density[cell] = remembered_density(remembered, sigma, cells.decay);
    __syncwarp();
  }
}

/// Adds up the densities of a cascade, one per blockIdx.y.
__global__ void sum_densities(const OccupancyCells cells) {
  const std::size_t of_cascade = cells.layout.cells_of_cascade();
  const float* density = cells.density + blockIdx.y * of_cascade;
  MeanDensity<float> mean;
  for (std::size_t i = blockIdx.x * std::size_t(blockDim.x) + threadIdx.x; i < of_cascade;
       i += std::size_t(gridDim.x) * blockDim.x) {
    mean.add(density[i]);
  }
  const float sum = warp_sum(mean.sum), included = warp_sum(mean.cells);
  if (threadIdx.x % 32 != 0) return;
  atomicAdd(&cells.means[blockIdx.y].sum, double(sum));
  atomicAdd(&cells.means[blockIdx.y].cells, double(included));
}

__global__ void set_bits(const OccupancyCells cells) {
  const std::size_t cell = blockIdx.x * std::size_t(blockDim.x) + threadIdx.x;  // cells are a multiple of 32
  if (cell >= cells.count()) return;
  const int cascade = int(cell / cells.layout.cells_of_cascade());
  const float threshold =
      occupancy_threshold(cells.optical_thickness, cells.layout.cell_side(cascade), cells.means[cascade].value());
  const unsigned word = __ballot_sync(~0u, cells.density[cell] > threshold);
  if (threadIdx.x % 32 == 0) cells.bits[cell / 32] = word;
}

GridLevels levels_of(const FieldView& field) {
  return {field.levels, std::size_t(field.n_levels)};
}

template <Keep kKeep>
void launch_trace(const TraceJob& job, cudaStream_t stream) {
  with_channel_tiles(job.field.n_levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    using Shared = TraceShared<KT>;
    const unsigned blocks = resident_blocks<trace<KT, kKeep>>(kThreads, sizeof(Shared));
    trace<KT, kKeep><<<blocks, kThreads, sizeof(Shared), stream>>>(levels_of(job.field), job);
    CNERF_CUDA(cudaGetLastError());
  });
}

}  // namespace

void trace_training_rays(const TraceJob& job, cudaStream_t stream) {
  launch_trace<Keep::kTraining>(job, stream);
}
void trace_to_samples(const TraceJob& job, cudaStream_t stream) {
  launch_trace<Keep::kSamples>(job, stream);
}
std::size_t tracing_warps(int n_levels) {
  std::size_t warps = 0;
  with_channel_tiles(n_levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    warps = kWarps * resident_blocks<trace<KT, Keep::kSamples>>(kThreads, sizeof(TraceShared<KT>));
  });
  return warps;
}

void query_field(const FieldView& field, const QueryJob& job, cudaStream_t stream) {
  with_channel_tiles(field.n_levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    using Shared = QueryShared<KT>;
    const unsigned most = resident_blocks<query<KT>>(kThreads, sizeof(Shared));
    const unsigned blocks = std::min(most, (job.count + kThreads - 1) / kThreads);
    query<KT><<<blocks, kThreads, sizeof(Shared), stream>>>(levels_of(field), field, job);
    CNERF_CUDA(cudaGetLastError());
  });
}

void update_occupancy(const FieldView& field, const OccupancyCells& cells, const OccupancyUpdate& update,
                      cudaStream_t stream) {
  with_channel_tiles(field.n_levels, [&](auto tiles) {
    constexpr int KT = decltype(tiles)::value;
    using Shared = QueryShared<KT>;
    const unsigned blocks = resident_blocks<visit_cells<KT>>(kThreads, sizeof(Shared));
    visit_cells<KT><<<blocks, kThreads, sizeof(Shared), stream>>>(levels_of(field), field, cells, update);
    CNERF_CUDA(cudaGetLastError());
  });
  refresh_occupancy_bits(cells, stream);
}

void refresh_occupancy_bits(const OccupancyCells& cells, cudaStream_t stream) {
  const auto cascades = std::size_t(cells.layout.cascades);
  CNERF_CUDA(cudaMemsetAsync(cells.means, 0, cascades * sizeof(*cells.means), stream));
  sum_densities<<<dim3(128, unsigned(cascades)), 256, 0, stream>>>(cells);
  set_bits<<<unsigned((cells.count() + 255) / 256), 256, 0, stream>>>(cells);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
