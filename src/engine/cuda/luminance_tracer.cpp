#include "src/engine/cuda/luminance_tracer.h"

#include <algorithm>

#include "src/base/check.h"

namespace cnerf {
namespace {

constexpr std::uint32_t kRaysAtATime = 1 << 18;  // of a rendering
constexpr std::size_t kUsualSamples = 16;        // that are kept of a ray
constexpr std::size_t kMostSamples = ~std::uint32_t(0);

const char* const kTracedAdvice = "rays";

}  // namespace

TraceJob LuminanceTracerCuda::job(const FieldView& field, std::uint32_t rays, const MarchSettings& march,
                                  const RenderEffort& effort) {
  state_.reserve(1, kTracedAdvice);
  rays_.reserve(rays, kTracedAdvice);
  directions_.reserve(rays, kTracedAdvice);
  StepState state;
  state.rays = state.end_ray = rays;
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
  plain_rays_.reserve(count, kTracedAdvice);
  plain_rays_.upload(rays.data(), count, stream_);
  prepare_rays(plain_rays_.data(), count, rays_.data(), directions_.data(), stream_);
  return trace;
}

void LuminanceTracerCuda::render(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                                 const RenderEffort& effort, std::span<RayResult> results) {
  for (std::size_t first = 0; first < rays.size(); first += kRaysAtATime) {
    const std::size_t count = std::min<std::size_t>(kRaysAtATime, rays.size() - first);
    results_.reserve(count, kTracedAdvice);
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
  results_.reserve(count, kTracedAdvice);
  TraceJob trace = job(field, count, march, effort);
  camera_rays(camera, count, rays_.data(), directions_.data(), stream_);
  trace.results = results_.data();
  render_rays(trace, stream_);
  results_.download(results.data(), results.size(), stream_);
  wait();
}

void LuminanceTracerCuda::trace_to(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                                   const RenderEffort& effort, TracedBuffers& to) {
  scratch_.reserve(tracing_warps(field.n_levels) * kMostSamplesOfRay, kTracedAdvice);
  to.begins.reserve(rays.size(), kTracedAdvice);
  to.ends.reserve(rays.size(), kTracedAdvice);
  to.results.reserve(rays.size(), kTracedAdvice);
  to.rays = std::uint32_t(rays.size());
  std::size_t room = kUsualSamples * rays.size();
  while (true) {
    to.positions.reserve(room, kTracedAdvice);
    for (auto* buffer : {&to.t, &to.weights, &to.luminance}) buffer->reserve(room, kTracedAdvice);
    // An earlier call may have had memory for some of them only.
    const std::size_t capacity =
        std::min({to.positions.size(), to.t.size(), to.weights.size(), to.luminance.size(), kMostSamples});
    TraceJob trace = job_of_rays(field, rays, march, effort);
    trace.kept = {scratch_.data(), effort.shaded_share, std::uint32_t(capacity), to.positions.data(),
                  to.t.data(),     to.weights.data(),   to.luminance.data(),     to.begins.data(),
                  to.ends.data(),  to.results.data()};
    trace_to_samples(trace, stream_);
    wait();
    to.samples = state_.downloaded().front().samples;
    if (to.samples <= trace.kept.capacity) return;
    room = to.samples;
  }
}

void LuminanceTracerCuda::trace(const FieldView& field, std::span<const Ray> rays, const MarchSettings& march,
                                const RenderEffort& effort, std::vector<WeightedSample>& samples,
                                std::vector<std::size_t>& offsets) {
  samples.clear();
  offsets.assign(1, 0);
  for (std::size_t first = 0; first < rays.size(); first += kTracedAtATime) {
    const std::size_t count = std::min<std::size_t>(kTracedAtATime, rays.size() - first), before = samples.size();
    trace_to(field, rays.subspan(first, count), march, effort, to_host_);
    const RayOrder order(to_host_);
    const std::vector<float> t = order.unordered(to_host_.t), weights = order.unordered(to_host_.weights),
                             luminance = order.unordered(to_host_.luminance);
    for (std::size_t r = 0; r < count; ++r) offsets.push_back(before + order.offsets()[r + 1]);
    samples.resize(offsets.back());
    order.for_rays([&](std::size_t from, std::size_t to, std::size_t of_ray) {
      for (std::size_t s = 0; s < of_ray; ++s) {
        samples[before + to + s] = {t[from + s], weights[from + s], luminance[from + s]};
      }
    });
  }
}

std::unique_ptr<TracedPixels> LuminanceTracerCuda::trace_pixels(const FieldView& field, std::span<const Ray> rays,
                                                                const MarchSettings& march,
                                                                const RenderEffort& effort) {
  // Memory of pixels that nobody looks at any more serves again: a picture is traced in many parts.
  if (!kept_ || kept_.use_count() > 1) kept_ = std::make_shared<TracedBuffers>();
  trace_to(field, rays, march, effort, *kept_);
  return std::make_unique<TracedPixelsCuda>(kept_);
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
