#include "src/engine/cuda/luminance_tracer.h"

#include <algorithm>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/engine/heaviest_samples.h"

namespace cnerf {
namespace {

constexpr std::uint32_t kRaysAtATime = 1 << 18;    // of a rendering
constexpr std::uint32_t kTracedAtATime = 1 << 14;  // rays whose samples are kept

const char* const kRayAdvice = "rays";

/// Puts traced samples in the order of their rays and leaves out the light ones.
void append_heaviest(std::span<const TracedRay> rays, const WeightedSample* found, const RenderEffort& effort,
                     std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) {
  constexpr std::size_t kRays = 256;  // of a part
  struct Part {
    std::vector<WeightedSample> samples;
    std::vector<std::size_t> offsets = {0};
  };
  std::vector<Part> parts((rays.size() + kRays - 1) / kRays);
  parallel_tasks(parts.size(), [&](std::size_t i) {
    Part& part = parts[i];
    for (const TracedRay& ray : rays.subspan(i * kRays, std::min(kRays, rays.size() - i * kRays))) {
      for (std::uint32_t s = 0; s < ray.samples; s += 32) {
        const WeightedSample* run = found + ray.run[s / 32];
        part.samples.insert(part.samples.end(), run, run + std::min(32u, ray.samples - s));
      }
      part.offsets.push_back(part.samples.size());
    }
    keep_heaviest(effort, part.samples, part.offsets);
  });
  std::vector<std::size_t> begins = {samples.size()};
  for (const Part& part : parts) {
    for (std::size_t r = 1; r < part.offsets.size(); ++r) offsets.push_back(begins.back() + part.offsets[r]);
    begins.push_back(begins.back() + part.samples.size());
  }
  samples.resize(begins.back());
  parallel_tasks(parts.size(), [&](std::size_t i) {
    std::copy(parts[i].samples.begin(), parts[i].samples.end(), samples.begin() + std::ptrdiff_t(begins[i]));
  });
}

}  // namespace

TraceJob LuminanceTracerCuda::job(const FieldView& field, std::uint32_t rays, const MarchSettings& march,
                                  const RenderEffort& effort) {
  state_.reserve(1, kRayAdvice);
  rays_.reserve(rays, kRayAdvice);
  directions_.reserve(rays, kRayAdvice);
  StepState state;
  state.rays = rays;
  state_.upload(&state, 1, stream_);
  TraceJob job{};
  job.field = field;
  job.layout = layout_;
  job.occupied = occupied_;
  job.march = march;
  job.min_transmittance = effort.min_transmittance;
  job.rays = rays_.data();
  job.directions = directions_.data();
  job.state = state_.data();
  return job;
}

TraceJob LuminanceTracerCuda::job_of_rays(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                                          const RenderEffort& effort) {
  const auto count = std::uint32_t(rays.size());
  const TraceJob trace = job(field, count, march, effort);
  plain_rays_.reserve(count, kRayAdvice);
  plain_rays_.upload(rays.data(), count, stream_);
  prepare_rays(plain_rays_.data(), count, rays_.data(), directions_.data(), stream_);
  return trace;
}

void LuminanceTracerCuda::render(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                                 const RenderEffort& effort, std::span<RayResult> results) {
  for (std::size_t first = 0; first < rays.size(); first += kRaysAtATime) {
    const std::size_t count = std::min<std::size_t>(kRaysAtATime, rays.size() - first);
    results_.reserve(count, kRayAdvice);
    TraceJob trace = job_of_rays(field, rays.subspan(first, count), march, effort);
    trace.results = results_.data();
    render_rays(trace, stream_);
    results_.download(results.data() + first, count, stream_);
    wait();
  }
}

void LuminanceTracerCuda::render_view(const FieldView& field, const UnitCamera& camera, const MarchSettings& march,
                                      const RenderEffort& effort, std::span<RayResult> results) {
  const auto count = std::uint32_t(camera.intrinsics.width) * std::uint32_t(camera.intrinsics.height);
  results_.reserve(count, kRayAdvice);
  TraceJob trace = job(field, count, march, effort);
  camera_rays(camera, count, rays_.data(), directions_.data(), stream_);
  trace.results = results_.data();
  render_rays(trace, stream_);
  results_.download(results.data(), results.size(), stream_);
  wait();
}

void LuminanceTracerCuda::trace(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                                const RenderEffort& effort, std::vector<WeightedSample>& samples,
                                std::vector<std::size_t>& offsets) {
  samples.clear();
  offsets.assign(1, 0);
  std::uint32_t most = kTracedAtATime;
  const std::size_t room = std::size_t(1) << 22;
  if (weighted_.size() < room) weighted_ = {room, kRayAdvice};
  traced_.reserve(most, kRayAdvice);
  if (!found_) found_ = std::make_unique<MappedBuffer<WeightedSample>>(room);
  WeightedSample* found = &(*found_)[0];
  for (std::size_t first = 0; first < rays.size();) {
    const auto count = std::uint32_t(std::min<std::size_t>(most, rays.size() - first));
    TraceJob trace = job_of_rays(field, rays.subspan(first, count), march, effort);
    trace.weighted = weighted_.data();
    trace.weighted_capacity = std::uint32_t(room);
    trace.traced = traced_.data();
    trace_to_samples(trace, stream_);
    wait();
    const StepState state = state_.downloaded().front();
    if (state.samples > trace.weighted_capacity) {
      most = count / 2;  // too many samples: fewer rays at a time
      continue;
    }
    std::vector<TracedRay> of_rays(count);
    weighted_.download(found, state.samples, stream_);
    traced_.download(of_rays.data(), count, stream_);
    wait();
    append_heaviest(of_rays, found, effort, samples, offsets);
    // As many samples per ray as so far: memory hardly ever moves.
    if (first == 0) samples.reserve(samples.size() * (rays.size() / count + 1));
    first += count;
  }
}

void LuminanceTracerCuda::query(const FieldView& field, std::span<const Vec3f> positions,
                                std::span<const Vec3f> directions, std::span<float> answers) {
  CNERF_CHECK_EQ(positions.size(), answers.size());
  CNERF_CHECK(directions.empty() || directions.size() == positions.size(), "one direction per point, or none");
  const bool asks_density = directions.empty();
  for (std::size_t first = 0; first < positions.size(); first += kPointsAtATime) {
    const std::size_t count = std::min<std::size_t>(kPointsAtATime, positions.size() - first);
    points_.reserve(count, "points");
    answers_.reserve(count, "points");
    points_.upload(positions.data() + first, count, stream_);
    if (!asks_density) {
      point_directions_.reserve(count, "points");
      point_directions_.upload(directions.data() + first, count, stream_);
    }
    query_field(
        field,
        {points_.data(), asks_density ? nullptr : point_directions_.data(), std::uint32_t(count), answers_.data()},
        stream_);
    answers_.download(answers.data() + first, count, stream_);
    wait();
  }
}

}  // namespace cnerf
