#include "src/engine/cuda/ray_gradient_kernel.h"

#include "src/base/cuda/device_memory.h"
#include "src/base/cuda/launch.h"
#include "src/base/cuda/warp.cuh"
#include "src/engine/stage1_loss.h"
#include "src/render/cuda/run_optics.cuh"

namespace cnerf {
namespace {

constexpr int kWarps = 8;
constexpr int kThreads = 32 * kWarps;

/// A ray's distortion, a run of samples at a time.
struct RunDistortion {
  Distortion<float> of_runs;  ///< weight and moment of the runs so far; of the value this lane's share

  /// Adds a run, one sample per lane; returns the sums in front of this lane's sample.
  __device__ Distortion<float> add(float w, const LogInterval<float>& at) {
    const float own = w * at.place, weight = warp_prefix_sum(w), moment = warp_prefix_sum(own);
    Distortion<float> before = {of_runs.weight + weight - w, of_runs.moment + moment - own, of_runs.value};
    of_runs.weight += __shfl_sync(~0u, weight, 31);
    of_runs.moment += __shfl_sync(~0u, moment, 31);
    Distortion<float> through = before;
    through.add(w, at);
    of_runs.value = through.value;
    return before;
  }
  [[nodiscard]] __device__ Distortion<float> total() const {
    return {of_runs.weight, of_runs.moment, warp_sum(of_runs.value)};
  }
};

/// This lane's sample of a run. Lanes behind the ray's last sample have one that is neither seen nor kept.
struct RunSample {
  std::uint32_t at = 0;
  bool is_there = false;
  float depth = 0;  ///< optical
  float raw_luminance = 0;
  float t = 0;
};

/// A traced ray; one warp goes over its runs, front to back.
class TracedRay {
 public:
  __device__ TracedRay(const RayGradientJob& job, std::uint32_t index)
      : job_(&job), record_(job.rays[index]), has_room_(job.runs[index].has_room), samples_(job.runs[index].samples) {
    const int lane = int(threadIdx.x) % 32;
    if (32 * lane < samples_) begin_ = job.runs[index].begins[lane];
    weights_ = {job.distortion_weight, job.depth.weight_at(job.state->step)};
    has_depth_ = weights_.depth > 0 && target().depth.is_known();
  }

  /// Adds the ray's loss to `sums`, and turns what tracing left of its samples into gradients.
  __device__ void differentiate(StepState& sums) const {
    const unsigned lane = threadIdx.x % 32;
    SeenRay seen;
    RayShape shape;
    composite(seen, shape);
    const RayError error(seen, target());
    if (lane == 0) {
      sums.loss += ray_loss(error, shape, weights_);
      sums.squared_error += squared_error(seen, target());
    }
    const float scale = has_room_ ? 1.0f / float(job_->state->rays) : 0.0f;
    const RayGradient gradient(error, target().gain, shape, weights_, scale);
    if (job_->view_gradients != nullptr && lane == 0) {
      atomicAdd(&job_->view_gradients[record_.view].by_log_gain, gradient.by_log_gain(seen, target()));
    }
    float distortion_behind = gradient.distortion_of_all(), depth_behind = shape.depth_miss;
    RunDistortion passed;
    float depth = 0, composited = 0;
    for (int first = 0; first < samples_; first += 32) {
      const RunSample run = run_at(first);
      const RunOptics<> optics(depth, run.depth);
      LitSample sample{1.0f, job_->activation.value(run.raw_luminance), optics.weight(), optics.transmittance_after()};
      sample.composited = composited + warp_prefix_sum(sample.weight * sample.luminance);
      float d_depth = gradient.by_density(sample);
      if (weights_.distortion > 0) {
        const LogInterval<float> interval = interval_of(run);
        const Distortion<float> before = passed.add(sample.weight, interval);
        const float slope = gradient.distortion_by_weight(sample.weight, interval, before);
        const float taken = warp_prefix_sum(sample.weight * slope);
        d_depth += gradient.by_density_of_distortion(sample, slope, distortion_behind - taken);
        distortion_behind -= __shfl_sync(~0u, taken, 31);
      }
      if (has_depth_) {
        const float miss = depth_miss(run.t, target().depth), taken = warp_prefix_sum(sample.weight * miss);
        d_depth += gradient.by_density_of_depth(sample, miss, depth_behind - taken);
        depth_behind -= __shfl_sync(~0u, taken, 31);
      }
      const float d_raw = gradient.by_luminance(sample) * job_->activation.derivative(run.raw_luminance);
      if (run.is_there) job_->samples.gradients[run.at] = make_float2(d_raw, run.depth * d_depth);
      depth = optics.depth_at(31);
      composited = __shfl_sync(~0u, sample.composited, 31);
    }
  }

 private:
  [[nodiscard]] __device__ const RayTarget& target() const { return record_.target; }
  [[nodiscard]] __device__ LogInterval<float> interval_of(const RunSample& run) const {
    return {run.t, march_step(job_->march, run.t)};
  }

  [[nodiscard]] __device__ RunSample run_at(int first) const {
    const int lane = int(threadIdx.x) % 32;
    RunSample run;
    run.at = __shfl_sync(~0u, begin_, first / 32) + std::uint32_t(lane);
    run.is_there = first + lane < samples_ && run.at < job_->samples.capacity;
    if (!run.is_there) return run;
    const float2 traced = job_->samples.gradients[run.at];
    run.depth = traced.x;
    run.raw_luminance = traced.y;
    const float4 place = job_->samples.places[run.at];
    run.t = dot(Vec3f{place.x, place.y, place.z} - record_.ray.origin, record_.ray.direction);
    return run;
  }

  __device__ void composite(SeenRay& seen, RayShape& shape) const {
    RunDistortion distortion;
    float depth = 0, luminance = 0, miss = 0;  // the last two: this lane's share
    for (int first = 0; first < samples_; first += 32) {
      const RunSample run = run_at(first);
      const RunOptics<> optics(depth, run.depth);
      const float weight = optics.weight();
      luminance += weight * job_->activation.value(run.raw_luminance);
      if (weights_.distortion > 0) distortion.add(weight, interval_of(run));
      if (has_depth_) miss += weight * depth_miss(run.t, target().depth);
      depth = optics.depth_at(31);
    }
    seen = {warp_sum(luminance), expf(-depth)};
    shape = {distortion.total(), has_depth_ ? warp_sum(miss) + seen.transmittance : 0.0f};
  }

  const RayGradientJob* job_;
  const RayRecord& record_;
  bool has_room_;
  int samples_;
  std::uint32_t begin_ = 0;  // of the run with this lane's number
  ShapeWeights weights_;
  bool has_depth_;
};

__global__ void __launch_bounds__(kThreads) differentiate(const __grid_constant__ RayGradientJob job) {
  __shared__ double losses[kWarps], squared_errors[kWarps];
  const unsigned warp = threadIdx.x / 32;
  StepState sums;
  for (std::uint32_t ray = job.state->first_ray + blockIdx.x * kWarps + warp; ray < job.state->end_ray;
       ray += gridDim.x * kWarps) {
    TracedRay(job, ray).differentiate(sums);
  }
  if (threadIdx.x % 32 == 0) {
    losses[warp] = sums.loss;
    squared_errors[warp] = sums.squared_error;
  }
  __syncthreads();
  if (threadIdx.x != 0) return;
  for (int other = 1; other < kWarps; ++other) {
    sums.loss += losses[other];
    sums.squared_error += squared_errors[other];
  }
  atomicAdd(&job.state->loss, sums.loss);
  atomicAdd(&job.state->squared_error, sums.squared_error);
}

}  // namespace

void differentiate_rays(const RayGradientJob& job, cudaStream_t stream) {
  differentiate<<<resident_blocks<differentiate>(kThreads, 0), kThreads, 0, stream>>>(job);
  CNERF_CUDA(cudaGetLastError());
}

}  // namespace cnerf
