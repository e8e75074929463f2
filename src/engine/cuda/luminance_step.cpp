#include "src/engine/cuda/luminance_step.h"

#include "src/engine/stage1_schedule.h"
#include "src/field/cuda/channel_tiles.h"

namespace cnerf {
namespace {

constexpr long kMostAhead = kStepRing / 2;

const char* const kSampleAdvice = "the samples of a step; lower stage1.samples_per_step";
const char* const kRayAdvice = "rays";

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
      directions_(std::size_t(kMostRays), kRayAdvice) {}

LuminanceStepCuda::~LuminanceStepCuda() {
  cudaStreamSynchronize(stream_);
  if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
}

void LuminanceStepCuda::set_views(const std::vector<TrainingView>& views) {
  forget_graph();
  views_ = ViewImages(views);
}

void LuminanceStepCuda::restart(long step, std::int64_t rays) {
  CNERF_CUDA(cudaStreamSynchronize(stream_));
  steps_ = restarted_at_ = step;
  StepState state;
  state.step = step;
  state.rays = std::uint32_t(rays);
  state_.upload(&state, 1);
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
  return job;
}

FieldSamples LuminanceStepCuda::samples() const {
  return {{&state_.data()->samples, capacity_}, places_.data(), directions_.data(), encoded_.data(), gradients_.data()};
}

/// The nets' optimiser and the hash grid's backward pass need the same gradients and nothing of each other.
void LuminanceStepCuda::launch(const std::uint32_t* occupied) {
  const AdamStep* adam = &state_.data()->adam;
  begin_step(state_.data(), learning_rates_.on_device(), stream_);
  draw_training_rays({state_.data(), views_.records(), views_.count(), options_.seed, rays_.data(), directions_.data()},
                     stream_);
  trace_training_rays(trace_job(occupied), stream_);
  field_.nets_backward(samples(), stream_);
  fork_.record(stream_);
  fork_.hold(side_);
  field_.update_nets(adam, side_);
  join_.record(side_);
  field_.grid_backward(samples(), stream_);
  field_.update_grid(adam, stream_);
  join_.hold(stream_);
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
