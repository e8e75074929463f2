#pragma once
/// The kernels that follow rays: march, hash grid, nets and compositing. Training and tracing take a warp per ray and
/// differ in what they keep of its samples; rendering (render_kernel.cu) keeps nothing of what lies between.

#include <cuda_runtime_api.h>

#include <cstdint>

#include "encoding/hash_grid_levels.h"
#include "src/engine/cuda/step_kernels.h"
#include "src/engine/luminance_engine.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/cuda/field_weights.h"
#include "src/render/cuda/ray_record.h"
#include "src/render/march.h"
#include "src/render/occupancy_math.h"

namespace cnerf {

/// Samples of training rays, in runs of up to 32 of one ray.
struct SampleArrays {
  std::uint32_t capacity = 0;
  float4* places = nullptr;     ///< x, y, z in [0, 1], and the ray's number as bits
  uint4* encoded = nullptr;     ///< [capacity, 16 KT] halves
  float2* gradients = nullptr;  ///< of the loss by the luminance net's raw output and by log density
};

/// Of one ray's samples, in runs of 32.
inline constexpr int kMostRuns = kMostSamplesOfRay / 32;
static_assert(kMostRuns <= 32, "a lane knows of a run each");

/// Where the samples of a training ray lie: in runs of 32, wherever there was room.
struct RayRuns {
  std::int32_t samples = 0;
  bool has_room = true;             ///< for all of them
  std::uint32_t begins[kMostRuns];  ///< of the runs there are
};

/// What tracing keeps of rays: the heaviest of their samples (heaviest_samples.h).
struct KeptSamples {
  WeightedSample* scratch = nullptr;  ///< [tracing_warps(), kMostSamplesOfRay]
  float share = 1;                    ///< of a ray's weight that is kept
  std::uint32_t capacity = 0;         ///< where it does not suffice, what is kept is of no use
  // [capacity], a ray's samples in a row, front to back; rays in any order:
  Vec3f* positions = nullptr;
  float *t = nullptr, *weights = nullptr, *luminance = nullptr;
  // [rays]
  std::uint32_t *begins = nullptr, *ends = nullptr;
  RayResult* results = nullptr;
};

struct TraceJob {
  FieldView field;
  OccupancyLayout layout;
  const std::uint32_t* occupied;
  MarchSettings march;
  float min_transmittance;
  const RayRecord* rays;
  const DirectionCode* directions;
  StepState* state;  ///< next_ray, end_ray, samples
  // Training:
  SampleArrays samples;     ///< gradients: left as optical depth and the luminance net's raw output
  RayRuns* runs = nullptr;  ///< [rays]
  // Rendering:
  RayResult* results = nullptr;
  // Tracing:
  KeptSamples kept;
};

void trace_training_rays(const TraceJob& job, cudaStream_t stream);
void trace_to_samples(const TraceJob& job, cudaStream_t stream);
/// Warps that `trace_to_samples` runs, at most.
[[nodiscard]] std::size_t tracing_warps(int n_levels);

/// Follows rays to `results`. Answers differ from those of traced samples in what is left dark, 16 samples at a time
/// that together add less than a tenth of an 8-bit step to a pixel, and in that samples are not counted: a ray goes on
/// until it is opaque or leaves the box.
void render_rays(const TraceJob& job, cudaStream_t stream);

struct QueryJob {
  const Vec3f* positions;   ///< [count]
  const Vec3f* directions;  ///< [count]; null: density is asked for
  std::uint32_t count;
  float* answers;  ///< [count], written: density, or the luminance seen along the directions
};
void query_field(const FieldView& field, const QueryJob& job, cudaStream_t stream);

/// The occupancy grid in device memory.
struct OccupancyCells {
  OccupancyLayout layout;
  float decay = 0, optical_thickness = 0;  ///< see OccupancyOptions
  float* density = nullptr;                ///< [cascades, R, R, R]
  MeanDensity<double>* means = nullptr;    ///< [cascades], scratch
  std::uint32_t* bits = nullptr;           ///< one per cell

  [[nodiscard]] CNERF_HD std::size_t count() const { return layout.cells_of_cascade() * std::size_t(layout.cascades); }
};
/// As OccupancyGrid::update: visits cells, then renews the bits.
void update_occupancy(const FieldView& field, const OccupancyCells& cells, const OccupancyUpdate& update,
                      cudaStream_t stream);
/// Only the bits.
void refresh_occupancy_bits(const OccupancyCells& cells, cudaStream_t stream);

}  // namespace cnerf
