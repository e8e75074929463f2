#pragma once
/// A training step of stage 1 on the GPU: one graph of kernels. Rays are drawn and followed (march, hash grid, nets,
/// loss and its gradient), then come the nets backward, the hash grid backward, Adam. The host only says the learning
/// rate and never waits for a step, except that it keeps no more than a few ahead.
///
/// A step that processes share is no graph: a library's sums lie between its kernels. Those of the hash grid's levels
/// are under way while the next levels' gradients are found and the last ones' rows take their step.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "src/base/cuda/stream.h"
#include "src/engine/cuda/ray_gradient_kernel.h"
#include "src/engine/cuda/shared_grid.h"
#include "src/engine/cuda/view_images.h"
#include "src/engine/luminance_engine.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/cuda/luminance_field.h"

namespace cnerf {

/// Room for samples of a step: an average one may take twice as many as wanted, and the fewest rays all that they have.
[[nodiscard]] inline std::uint32_t sample_capacity(const LuminanceEngineOptions& options) {
  return std::max(std::uint32_t(options.samples_per_step) * 2, std::uint32_t(kFewestRays * kMostSamplesOfRay));
}

class LuminanceStepCuda {
 public:
  /// @param field  with room for `sample_capacity` samples; must outlive this, as `stream` must
  LuminanceStepCuda(const LuminanceEngineOptions& options, const LuminanceFieldCuda& field, cudaStream_t stream);
  ~LuminanceStepCuda();
  LuminanceStepCuda(const LuminanceStepCuda&) = delete;
  LuminanceStepCuda& operator=(const LuminanceStepCuda&) = delete;

  /// Of the views that are set next; less where the GPU has no more.
  void limit_image_memory(std::size_t bytes) { image_memory_ = bytes; }
  void set_views(const std::vector<TrainingView>& views);
  /// See LuminanceEngine::share_steps.
  void share(const StepShare& share);
  /// See LuminanceEngine::complete_state.
  void complete_state();
  /// Goes on from here.  @param rays  of the next step
  void restart(long step, std::int64_t rays);
  [[nodiscard]] long steps() const { return steps_; }
  /// Of the next step; waits.
  [[nodiscard]] std::int64_t rays() const { return state_.downloaded().front().rays; }
  /// What was learned of the views, and the moments; copies, to be given back to `set_learned`. Waits.
  [[nodiscard]] std::vector<ViewCorrection> corrections() const { return corrections_.downloaded(); }
  [[nodiscard]] std::vector<ViewMoments> correction_moments() const { return correction_moments_.downloaded(); }
  void set_learned(const std::vector<ViewCorrection>& corrections, const std::vector<ViewMoments>& moments);
  /// The same of the lenses.
  [[nodiscard]] std::vector<LensCorrection> lenses() const { return lenses_.downloaded(); }
  [[nodiscard]] std::vector<LensMoments> lens_moments() const { return lens_moments_.downloaded(); }
  void set_lenses(const std::vector<LensCorrection>& lenses, const std::vector<LensMoments>& moments);

  /// @param occupied  the occupancy grid's bits; the same memory each time
  /// @return  the report of the latest step that is known to be done, at most a few steps ago
  StepReport run(float learning_rate, const std::uint32_t* occupied);

 private:
  void launch(const std::uint32_t* occupied);
  void launch_shared(const std::uint32_t* occupied);
  void draw_and_trace(const std::uint32_t* occupied);
  void teach_cameras(cudaStream_t stream);
  void hand_round(const LevelRange& part);
  void follow(cudaStream_t first, cudaStream_t then);
  void capture(const std::uint32_t* occupied);
  void forget_graph();
  [[nodiscard]] SampleArrays sample_arrays() const;
  [[nodiscard]] TraceJob trace_job(const std::uint32_t* occupied) const;
  [[nodiscard]] RayGradientJob gradient_job() const;
  [[nodiscard]] FieldSamples samples() const;
  [[nodiscard]] LearnedViews learned() const;

  LuminanceEngineOptions options_;
  std::uint32_t capacity_;
  const LuminanceFieldCuda& field_;
  cudaStream_t stream_;
  std::size_t image_memory_ = std::numeric_limits<std::size_t>::max();
  ViewImages views_;

  DeviceBuffer<StepState> state_;
  DeviceBuffer<float4> places_;
  DeviceBuffer<float2> gradients_;
  DeviceBuffer<uint4> encoded_;
  DeviceBuffer<RayRecord> rays_;
  DeviceBuffer<DirectionCode> directions_;
  DeviceBuffer<RayRuns> runs_;
  DeviceBuffer<ViewCorrection> corrections_;  // of the views, where they are learned
  DeviceBuffer<ViewMoments> correction_moments_;
  DeviceBuffer<LensCorrection> lenses_;  // likewise
  DeviceBuffer<LensMoments> lens_moments_;
  /// Of the views, of the lenses, then kStepSums numbers of the step; which the nets' gradient follows
  /// where processes share steps, so that all of it is one sum.
  DeviceBuffer<float> small_gradients_;

  MappedBuffer<float> learning_rates_{kStepRing};
  MappedBuffer<StepRecord> reports_{kStepRing};
  StepShare share_;
  std::optional<SharedGrid> shared_grid_;
  std::optional<CudaStream> sums_;  // what processes exchange
  CudaEvent ready_, updated_;
  CudaStream side_;
  CudaEvent done_[kStepRing], fork_, join_;
  cudaGraphExec_t graph_ = nullptr;
  bool is_warm_ = false;  // every kernel of a step has run once
  long steps_ = 0, restarted_at_ = 0;
};

}  // namespace cnerf
