#pragma once
/// The small kernels around a training step: its rays and its bookkeeping.

#include <cuda_runtime_api.h>

#include <cstdint>

#include "src/engine/luminance_engine.h"
#include "src/engine/view_learning.h"
#include "src/field/cuda/field_weights.h"
#include "src/optim/adam.h"
#include "src/render/cuda/ray_record.h"
#include "src/render/observed_ray.h"

namespace cnerf {

/// What a training step knows about itself, on the GPU.
struct StepState {
  std::int64_t step = 0;        ///< steps done
  std::uint32_t rays = 0;       ///< of this step, by all processes
  std::uint32_t first_ray = 0;  ///< of this process
  std::uint32_t end_ray = 0;    ///< behind the last ray of this process
  std::uint32_t next_ray = 0;   ///< not yet taken by a warp
  std::uint32_t samples = 0;    ///< allocated; may exceed the capacity
  double loss = 0, squared_error = 0;
  AdamStep adam;
};

/// A training view on the GPU; images keep the depth they came in.
struct ViewRecord {
  UnitCamera camera;
  int width = 0, height = 0;
  PixelDepth depth = PixelDepth::kU8;
  const void* pixels = nullptr;
  const float* decoded = nullptr;        ///< linear luminance of every integer value; null for floats
  const std::uint8_t* alpha = nullptr;   ///< null: opaque
  const std::uint8_t* mask = nullptr;    ///< null: every pixel counts
  const SkyLabel* sky_labels = nullptr;  ///< null: no pixel shows the sky
  DirectionView sky;
  const DepthHint* depths = nullptr;  ///< [rows, columns]; null: nothing is known
  int depth_columns = 0, depth_rows = 0;
  int lens = 0;      ///< see TrainingView
  Intrinsics given;  ///< the camera's, which are corrected as they are learned
};

/// What a step reports, in host memory that kernels write to.
struct StepRecord {
  double loss = 0, squared_error = 0;
  unsigned long long rays = 0, trained = 0;
};

/// Steps that may be under way at once: places in the rings of learning rates and reports.
inline constexpr int kStepRing = 8;

/// Which of the processes that share a step this is.
struct StepPart {
  int part = 0, parts = 1;
};
/// Sets the state up for the next step, with its learning rate and this process's range of rays.
void begin_step(StepState* state, const float* learning_rates, const StepPart& part, cudaStream_t stream);

struct DrawJob {
  const StepState* state;
  const ViewRecord* views;
  const ViewCorrection* corrections;  ///< of the views; null: none
  std::uint32_t n_views;              ///< that pixels are drawn from
  const std::uint32_t* resident;      ///< [n_views], their numbers; null: the first ones
  std::uint64_t seed;
  DepthLearning depth;
  RayRecord* rays;
  DirectionCode* directions;
};
/// This process's rays of the step (observed_ray.h), at most kMostRays.
void draw_training_rays(const DrawJob& job, cudaStream_t stream);
/// Where the pixels of a view lie by now.
struct PlacedView {
  std::uint32_t view = 0;
  const void* pixels = nullptr;
  const std::uint8_t *alpha = nullptr, *mask = nullptr;
  const SkyLabel* sky_labels = nullptr;
};
/// Lets pixels be drawn from a view.  @param resident  its place among those that they are drawn from
void put_view(const PlacedView& placed, ViewRecord* views, std::uint32_t* resident, cudaStream_t stream);
/// Plain rays, to be marched from the middle of the first step.
void prepare_rays(const Ray* rays, std::uint32_t count, RayRecord* records, DirectionCode* directions,
                  cudaStream_t stream);
/// The rays of an image's pixels, row by row.
void camera_rays(const UnitCamera& camera, std::uint32_t count, RayRecord* records, DirectionCode* directions,
                 cudaStream_t stream);

/// Corrections of views in device memory, one per view.
struct LearnedViews {
  ViewLearning learning;
  ViewCorrection* corrections = nullptr;
  ViewMoments* moments = nullptr;
  ViewGradient* gradients = nullptr;  ///< of the step; zero between steps
  LensCorrection* lenses = nullptr;
  LensMoments* lens_moments = nullptr;
  LensGradient* lens_gradients = nullptr;  ///< likewise
};
/// Adam, every few steps the gauge (view_learning.h). The gradients are zero afterwards.
/// @param views  their cameras get the lenses
void update_corrections(const LearnedViews& learned, ViewRecord* views, const StepState* state, cudaStream_t stream);
/// Gives the views' cameras the lenses as they are.
void use_lenses(const LearnedViews& learned, ViewRecord* views, cudaStream_t stream);

/// Floats of a step's loss, error and samples, to be summed over processes.
inline constexpr int kStepSums = 4;
/// Takes them from the state, and brings them back.
void pack_step_sums(const StepState* state, float* sums, cudaStream_t stream);
void unpack_step_sums(const float* sums, StepState* state, cudaStream_t stream);

/// Reports the step and chooses how many rays the next one takes.
/// @param capacity  of the arrays of samples, of all processes together
void end_step(StepState* state, std::uint32_t wanted_samples, std::uint32_t capacity, StepRecord* reports,
              cudaStream_t stream);

}  // namespace cnerf
