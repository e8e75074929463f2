#include "src/engine/cuda/luminance_step.h"

#include <algorithm>

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

/// Floats.
std::size_t small_gradients(const ViewLearning& learning) {
  static_assert(sizeof(ViewGradient) == kViewNumbers * sizeof(float));
  static_assert(sizeof(LensGradient) == kLensNumbers * sizeof(float));
  return std::size_t(kViewNumbers * learning.views + kLensNumbers * learning.lenses + kStepSums);
}

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
      runs_(std::size_t(kMostRays), kRayAdvice),
      corrections_(std::size_t(options.learning.views), kViewAdvice),
      correction_moments_(std::size_t(options.learning.views), kViewAdvice),
      lenses_(std::size_t(options.learning.lenses), kViewAdvice),
      lens_moments_(std::size_t(options.learning.lenses), kViewAdvice),
      small_gradients_(small_gradients(options.learning), kViewAdvice) {}

LuminanceStepCuda::~LuminanceStepCuda() {
  cudaStreamSynchronize(stream_);
  if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
}

void LuminanceStepCuda::set_views(const std::vector<TrainingView>& views) {
  if (options_.learning.is_on()) CNERF_CHECK_EQ(views.size(), std::size_t(options_.learning.views));
  forget_graph();
  views_ = ViewImages();  // what these take is free as well
  std::size_t free = 0, total = 0;
  CNERF_CUDA(cudaMemGetInfo(&free, &total));
  views_ = ViewImages(views, image_memory_on_device(image_memory_, free));
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
  float* of_views = small_gradients_.data();
  float* of_lenses = of_views + kViewNumbers * options_.learning.views;
  return {options_.learning,
          corrections_.data(),
          correction_moments_.data(),
          reinterpret_cast<ViewGradient*>(of_views),
          lenses_.data(),
          lens_moments_.data(),
          reinterpret_cast<LensGradient*>(of_lenses)};
}

SampleArrays LuminanceStepCuda::sample_arrays() const {
  return {capacity_, places_.data(), encoded_.data(), gradients_.data()};
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
  job.samples = sample_arrays();
  job.runs = runs_.data();
  return job;
}

RayGradientJob LuminanceStepCuda::gradient_job() const {
  RayGradientJob job;
  job.activation = field_.view().activation;
  job.march = options_.march;
  job.rays = rays_.data();
  job.runs = runs_.data();
  job.samples = sample_arrays();
  job.depth = options_.depth;
  job.distortion_weight = options_.distortion_weight;
  if (options_.learning.exposures) job.view_gradients = learned().gradients;
  job.state = state_.data();
  return job;
}

FieldSamples LuminanceStepCuda::samples() const {
  return {{&state_.data()->samples, capacity_}, places_.data(), directions_.data(), encoded_.data(), gradients_.data()};
}

void LuminanceStepCuda::share(const StepShare& share) {
  check_sums(share);
  forget_graph();  // it knows where the gradients lie
  share_ = share;
  shared_grid_.reset();
  if (share.is_whole()) return;
  const std::size_t nets = std::size_t(field_weight_count(field_.levels()));
  small_gradients_ = DeviceBuffer<float>(small_gradients(options_.learning) + nets, "nets");
  shared_grid_.emplace(field_.grid(), share);
  if (!sums_) sums_.emplace();
}

void LuminanceStepCuda::complete_state() {
  if (!shared_grid_) return;
  CNERF_CUDA(cudaStreamSynchronize(stream_));
  shared_grid_->complete(*sums_);
  sums_->wait();
}

/// The nets' optimiser, the hash grid's backward pass and the views need the same gradients and nothing of each other.
void LuminanceStepCuda::launch(const std::uint32_t* occupied) {
  const AdamStep* adam = &state_.data()->adam;
  draw_and_trace(occupied);
  fork_.record(stream_);
  fork_.hold(side_);
  field_.update_nets(adam, side_);
  teach_cameras(side_);
  if (options_.learning.is_on()) update_corrections(learned(), views_.records(), state_.data(), side_);
  join_.record(side_);
  field_.grid_backward(samples(), stream_);
  join_.hold(stream_);  // what still reads the table
  field_.update_grid(adam, stream_);
  end_step(state_.data(), std::uint32_t(options_.samples_per_step), capacity_, reports_.on_device(), stream_);
}

void LuminanceStepCuda::draw_and_trace(const std::uint32_t* occupied) {
  begin_step(state_.data(), learning_rates_.on_device(), {share_.part, share_.parts}, stream_);
  const ViewCorrection* corrections = options_.learning.is_on() ? corrections_.data() : nullptr;
  draw_training_rays({state_.data(), views_.records(), corrections, views_.count(), views_.resident(), options_.seed,
                      options_.depth, rays_.data(), directions_.data()},
                     stream_);
  trace_training_rays(trace_job(occupied), stream_);
  differentiate_rays(gradient_job(), stream_);
  field_.nets_backward(samples(), stream_);
}

void LuminanceStepCuda::teach_cameras(cudaStream_t stream) {
  const ViewLearning& learning = options_.learning;
  if (!learning.poses && learning.lenses == 0) return;
  add_camera_gradients(
      field_.position_slopes(learning.pose_levels(field_.grid_levels())),
      {learned(), views_.records(), {&state_.data()->samples, capacity_}, places_.data(), rays_.data()}, stream);
}

/// Three queues: the hash grid's backward pass part by part, what processes exchange of the parts, and their updates.
void LuminanceStepCuda::launch_shared(const std::uint32_t* occupied) {
  const AdamStep* adam = &state_.data()->adam;
  draw_and_trace(occupied);
  fork_.record(stream_);
  fork_.hold(side_);
  float* of_step = small_gradients_.data() + small_gradients(options_.learning) - kStepSums;
  float* of_nets = of_step + kStepSums;
  teach_cameras(side_);  // before any row changes: it reads the table
  field_.write_nets_gradient(of_nets, side_);
  pack_step_sums(state_.data(), of_step, side_);
  follow(side_, *sums_);
  share_.on_device->sum({small_gradients_.data(), small_gradients_.size()}, *sums_);
  follow(*sums_, side_);
  field_.update_nets(of_nets, adam, side_);
  if (options_.learning.is_on()) update_corrections(learned(), views_.records(), state_.data(), side_);
  const LevelRange* updated = nullptr;
  for (const LevelRange& part : shared_grid_->parts()) {
    field_.grid_backward(part, samples(), stream_);
    shared_grid_->pack(part, stream_);
    follow(stream_, *sums_);
    shared_grid_->sum(part, *sums_);
    follow(*sums_, side_);
    if (updated != nullptr) hand_round(*updated);  // beside this part's update
    shared_grid_->update(part, adam, side_);
    updated_.record(side_);
    updated = &part;
  }
  hand_round(*updated);
  follow(*sums_, stream_);
  unpack_step_sums(of_step, state_.data(), stream_);  // not earlier: the backward passes count samples by the state
  end_step(state_.data(), std::uint32_t(options_.samples_per_step), capacity_ * std::uint32_t(share_.parts),
           reports_.on_device(), stream_);
}

/// Of the part that was updated last.
void LuminanceStepCuda::hand_round(const LevelRange& part) {
  updated_.hold(*sums_);
  shared_grid_->hand_round(part, *sums_);
}

/// What a queue holds by now comes before what is added to another.
void LuminanceStepCuda::follow(cudaStream_t first, cudaStream_t then) {
  ready_.record(first);
  ready_.hold(then);
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
  views_.follow(steps_, stream_);
  if (!share_.is_whole()) {
    launch_shared(occupied);
  } else if (!is_warm_) {
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
