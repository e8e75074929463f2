#pragma once
/// The kernel that follows rays and keeps their samples: march, hash grid, nets and compositing, a warp a ray. Training
/// and tracing differ in what they keep.

#include <cuda_runtime_api.h>

#include <cstdint>

#include "encoding/hash_grid_levels.h"
#include "src/engine/cuda/step_state.h"
#include "src/engine/luminance_engine.h"
#include "src/field/cuda/field_weights.h"
#include "src/field/luminance_activation.h"
#include "src/render/cuda/ray_record.h"
#include "src/render/march.h"
#include "src/render/occupancy_math.h"

namespace cnerf {

struct DirectionCode;

/// The field as kernels see it.
struct FieldView {
  const GridLevel* levels;  ///< host memory, [n_levels]
  int n_levels;
  const uint2* table;  ///< [rows, 4] halves
  PackedField nets;
  float density_scale;
  LuminanceActivation<float> activation;
};

/// Samples of training rays, in runs of up to 32 of one ray.
struct SampleArrays {
  std::uint32_t capacity = 0;
  float4* places = nullptr;     ///< x, y, z in [0, 1], and the ray's number as bits
  uint4* encoded = nullptr;     ///< [capacity, 16 KT] halves
  float2* gradients = nullptr;  ///< of the loss by the luminance net's raw output and by log density
};

/// A traced ray's samples: runs of 32, the last one shorter.
inline constexpr int kMostRuns = 32;
struct TracedRay {
  std::uint32_t run[kMostRuns];
  std::uint32_t samples;
};

struct TraceJob {
  FieldView field;
  OccupancyLayout layout;
  const std::uint32_t* occupied;
  MarchSettings march;
  float min_transmittance;
  const RayRecord* rays;
  const DirectionCode* directions;
  StepState* state;  ///< rays, next_ray, samples; training also sums up here
  // Training:
  SampleArrays samples;
  float distortion_weight = 0;
  // Rendering:
  RayResult* results = nullptr;
  // Tracing:
  WeightedSample* weighted = nullptr;
  std::uint32_t weighted_capacity = 0;
  TracedRay* traced = nullptr;
};

void trace_training_rays(const TraceJob& job, cudaStream_t stream);
void trace_to_samples(const TraceJob& job, cudaStream_t stream);

/// Density and luminance at points. `directions` null: density only.
void query_field(const FieldView& field, const Vec3f* positions, const Vec3f* directions, std::uint32_t count,
                 float* sigma, float* luminance, cudaStream_t stream);

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
