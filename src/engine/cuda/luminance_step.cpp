#include "src/engine/cuda/luminance_step.h"

#include "src/base/check.h"
#include "src/engine/cuda/pose_kernel.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/cuda/channel_tiles.h"

namespace cnerf {
namespace {

constexpr long kMostAhead = kStepRing / 2;

const char* const kSampleAdvice = "the samples of a step; lower stage1.samples_per_step";
const char* const kRayAdvice = "rays";
const char* const kViewAdvice = "views";

}  // namespace

LuminanceStepCuda::LuminanceStepCuda(const LuminanceEngineOptions& options, const LuminanceFieldCuda& field,
                                     cudaStream_t stream)
    : options_(options),
      capacity_(sample_capacity(options)),
      field_(field),
      stream_(stream),
      state_(1, "nets"),
      places_(capacity_, kSampleAdvice),
      gradients_(capacity_, kSampleAdvice),
      encoded_(capacity_ * std::size_t(2 * channel_tiles(field.levels())), kSampleAdvice),
      rays_(std::size_t(kMostRays), kRayAdvice),
      directions_(std::size_t(kMostRays), kRayAdvice),
      corrections_(std::size_t(options.learning.views), kViewAdvice),
      correction_moments_(std::size_t(options.learning.views), kViewAdvice),
      view_gradients_(std::size_t(options.learning.views), kViewAdvice),
      lenses_(std::size_t(options.learning.lenses), kViewAdvice),
      lens_moments_(std::size_t(options.learning.lenses), kViewAdvice),
      lens_gradients_(std::size_t(options.learning.lenses), kViewAdvice) {}

LuminanceStepCuda::~LuminanceStepCuda() {
  cudaStreamSynchronize(stream_);
  if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
}

void LuminanceStepCuda::set_views(const std::vector<TrainingView>& views) {
  if (options_.learning.is_on()) CNERF_CHECK_EQ(views.size(), std::size_t(options_.learning.views));
  forget_graph();
  views_ = ViewImages(views);
  use_lenses(learned(), views_.records(), stream_);
}

void LuminanceStepCuda::restart(long step, std::int64_t rays) {
  CNERF_CUDA(cudaStreamSynchronize(stream_));
  steps_ = restarted_at_ = step;
  StepState state;
  state.step = step;
  state.rays = std::uint32_t(rays);
  state_.upload(&state, 1);
}

void LuminanceStepCuda::set_learned(const std::vector<ViewCorrection>& corrections,
                                    const std::vector<ViewMoments>& moments) {
  corrections_.upload(corrections.data(), corrections.size());
  correction_moments_.upload(moments.data(), moments.size());
}

void LuminanceStepCuda::set_lenses(const std::vector<LensCorrection>& lenses, const std::vector<LensMoments>& moments) {
  lenses_.upload(lenses.data(), lenses.size());
  lens_moments_.upload(moments.data(), moments.size());
  use_lenses(learned(), views_.records(), stream_);
}

LearnedViews LuminanceStepCuda::learned() const {
  return {options_.learning, corrections_.data(),  correction_moments_.data(), view_gradients_.data(),
          lenses_.data(),    lens_moments_.data(), lens_gradients_.data()};
}

TraceJob LuminanceStepCuda::trace_job(const std::uint32_t* occupied) const {
  TraceJob job{};
  job.field = field_.view();
  job.layout = OccupancyLayout(options_.occupancy.resolution, options_.cascades);
  job.occupied = occupied;
  job.march = options_.march;
  job.min_transmittance = kTrainingTransmittance;
  job.rays = rays_.data();
  job.directions = directions_.data();
  job.state = state_.data();
  job.samples = {capacity_, places_.data(), encoded_.data(), gradients_.data()};
  job.distortion_weight = options_.distortion_weight;
  job.depth = options_.depth;
  if (options_.learning.exposures) job.view_gradients = view_gradients_.data();
  return job;
}

FieldSamples LuminanceStepCuda::samples() const {
  return {{&state_.data()->samples, capacity_}, places_.data(), directions_.data(), encoded_.data(), gradients_.data()};
}

/// The nets' optimiser, the hash grid's backward pass and the views need the same gradients and nothing of each other.
void LuminanceStepCuda::launch(const std::uint32_t* occupied) {
  const AdamStep* adam = &state_.data()->adam;
  begin_step(state_.data(), learning_rates_.on_device(), stream_);
  const ViewLearning& learning = options_.learning;
  const ViewCorrection* corrections = learning.is_on() ? corrections_.data() : nullptr;
  draw_training_rays(
      {state_.data(), views_.records(), corrections, views_.count(), options_.seed, rays_.data(), directions_.data()},
      stream_);
  trace_training_rays(trace_job(occupied), stream_);
  field_.nets_backward(samples(), stream_);
  fork_.record(stream_);
  fork_.hold(side_);
  field_.update_nets(adam, side_);
  if (learning.poses || learning.lenses > 0) {
    add_camera_gradients(
        field_.position_slopes(learning.pose_levels(field_.grid_levels())),
        {learned(), views_.records(), {&state_.data()->samples, capacity_}, places_.data(), rays_.data()}, side_);
  }
  if (learning.is_on()) update_corrections(learned(), views_.records(), state_.data(), side_);
  join_.record(side_);
  field_.grid_backward(samples(), stream_);
  join_.hold(stream_);  // what still reads the table
  field_.update_grid(adam, stream_);
  end_step(state_.data(), std::uint32_t(options_.samples_per_step), capacity_, reports_.on_device(), stream_);
}

void LuminanceStepCuda::capture(const std::uint32_t* occupied) {
  cudaGraph_t graph = nullptr;
  CNERF_CUDA(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal));
  launch(occupied);
  CNERF_CUDA(cudaStreamEndCapture(stream_, &graph));
  CNERF_CUDA(cudaGraphInstantiate(&graph_, graph, 0));
  CNERF_CUDA(cudaGraphDestroy(graph));
}

void LuminanceStepCuda::forget_graph() {
  CNERF_CUDA(cudaStreamSynchronize(stream_));
  if (graph_ != nullptr) CNERF_CUDA(cudaGraphExecDestroy(graph_));
  graph_ = nullptr;
}

StepReport LuminanceStepCuda::run(float learning_rate, const std::uint32_t* occupied) {
  const bool is_early = steps_ - restarted_at_ < kMostAhead;  // nothing to report yet but this step itself
  if (!is_early) done_[(steps_ - kMostAhead) % kStepRing].wait();
  learning_rates_[std::size_t(steps_ % kStepRing)] = learning_rate;
  if (!is_warm_) {
    launch(occupied);  // loads the kernels, which a capture must not do
    is_warm_ = true;
  } else {
    if (graph_ == nullptr) capture(occupied);
    CNERF_CUDA(cudaGraphLaunch(graph_, stream_));
  }
  done_[steps_ % kStepRing].record(stream_);
  if (is_early) done_[steps_ % kStepRing].wait();
  const long reported = is_early ? steps_ : steps_ - kMostAhead;
  ++steps_;
  const StepRecord& r = reports_[std::size_t(reported % kStepRing)];
  return {r.loss, r.squared_error, r.rays, r.trained};
}

}  // namespace cnerf
