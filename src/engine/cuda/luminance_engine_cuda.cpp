#include "src/engine/cuda/luminance_engine_cuda.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/engine/cuda/render_kernel.h"
#include "src/engine/cuda/trained_parameters.h"
#include "src/engine/heaviest_samples.h"
#include "src/engine/initial_state.h"
#include "src/engine/stage1_schedule.h"
#include "src/field/cuda/channel_tiles.h"
#include "src/field/cuda/field_backward.h"
#include "src/field/mlp_layout.h"

namespace cnerf {
namespace {

constexpr std::uint32_t kRaysAtATime = 1 << 18;    // of a rendering
constexpr std::uint32_t kPointsAtATime = 1 << 20;  // of a query
constexpr long kMostAhead = kStepRing / 2;

const char* const kGridAdvice = "the hash grid; lower stage1.grid.log2_rows or stage1.grid.levels";
const char* const kSampleAdvice = "the samples of a step; lower stage1.samples_per_step";
const char* const kImageAdvice = "the training images; raise capture.downscale";
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

/// Everything on the GPU but the images.
struct LuminanceEngineCuda::Memory {
  // The field.
  TrainedGrid grid;
  TrainedNet density, luminance;
  DeviceBuffer<std::uint16_t> forward, backward;
  DeviceBuffer<float> last_layer, d_weights;
  // A step.
  DeviceBuffer<StepState> state;
  DeviceBuffer<float> places, gradients;
  DeviceBuffer<std::uint16_t> encoded, d_encoded;
  DeviceBuffer<RayRecord> rays;
  DeviceBuffer<std::uint32_t> directions;  // 8 a ray
  // Occupancy.
  DeviceBuffer<float> cells;
  DeviceBuffer<std::uint32_t> bits;
  DeviceBuffer<MeanDensity<double>> means;
  // Rendering and queries, made when first asked for.
  DeviceBuffer<StepState> trace_state;
  DeviceBuffer<Ray> plain_rays;
  DeviceBuffer<RayRecord> trace_rays;
  DeviceBuffer<std::uint32_t> trace_directions;
  DeviceBuffer<RayResult> results;
  DeviceBuffer<WeightedSample> weighted;
  DeviceBuffer<TracedRay> traced;
  std::unique_ptr<MappedBuffer<WeightedSample>> found;  // a copy of `weighted`, pinned
  DeviceBuffer<Vec3f> points, point_directions;
  DeviceBuffer<float> answers;

  MappedBuffer<float> learning_rates{kStepRing};
  MappedBuffer<StepRecord> reports{kStepRing};
  cudaStream_t stream = nullptr, side = nullptr;
  cudaEvent_t done[kStepRing] = {}, fork = nullptr, join = nullptr;
  cudaGraphExec_t graph = nullptr;

  Memory() {
    CNERF_CUDA(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
    CNERF_CUDA(cudaStreamCreateWithFlags(&side, cudaStreamNonBlocking));
    for (cudaEvent_t& event : done) CNERF_CUDA(cudaEventCreateWithFlags(&event, cudaEventDisableTiming));
    CNERF_CUDA(cudaEventCreateWithFlags(&fork, cudaEventDisableTiming));
    CNERF_CUDA(cudaEventCreateWithFlags(&join, cudaEventDisableTiming));
  }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;
  ~Memory() {
    cudaStreamSynchronize(stream);
    if (graph != nullptr) cudaGraphExecDestroy(graph);
    for (cudaEvent_t event : done) cudaEventDestroy(event);
    cudaEventDestroy(fork);
    cudaEventDestroy(join);
    cudaStreamDestroy(side);
    cudaStreamDestroy(stream);
  }
  void wait() const { CNERF_CUDA(cudaStreamSynchronize(stream)); }

  template <typename Visit>
  void for_each_buffer(Visit&& visit) const {
    visit(grid), visit(density), visit(luminance), visit(forward), visit(backward), visit(last_layer), visit(d_weights),
        visit(state), visit(places), visit(gradients), visit(encoded), visit(d_encoded), visit(rays), visit(directions),
        visit(cells), visit(bits), visit(means), visit(trace_state), visit(plain_rays), visit(trace_rays),
        visit(trace_directions), visit(results), visit(weighted), visit(traced), visit(points), visit(point_directions),
        visit(answers);
  }
};

/// The images on the GPU, and what they were made from.
struct LuminanceEngineCuda::Views {
  std::vector<TrainingView> source;
  std::vector<DeviceBuffer<std::uint8_t>> planes;
  std::vector<DeviceBuffer<float>> tables;  // decoded values, one a kind of integer and transfer
  DeviceBuffer<ViewRecord> records;

  /// Whether these are the same images and cameras.
  [[nodiscard]] bool holds(const std::vector<TrainingView>& views) const {
    return std::equal(
        views.begin(), views.end(), source.begin(), source.end(), [](const TrainingView& a, const TrainingView& b) {
          return a.image == b.image && a.camera.intrinsics == b.camera.intrinsics &&
                 a.camera.origin == b.camera.origin && a.camera.unit_from_camera == b.camera.unit_from_camera;
        });
  }
};

LuminanceEngineCuda::LuminanceEngineCuda(const LuminanceEngineOptions& options)
    : options_(options),
      capacity_(std::uint32_t(options.samples_per_step) * 2),
      density_scale_(1.0f / std::ldexp(1.0f, 1 - options.cascades)),
      activation_(LuminanceActivation<float>::up_to(options.max_luminance)),
      memory_(std::make_unique<Memory>()),
      occupancy_(options.occupancy, options.cascades) {
  Memory& m = *memory_;
  m.grid = {options.grid, options.seed, kGridAdvice};
  const auto levels = int(m.grid.levels().size());
  const auto channels = std::size_t(16 * channel_tiles(levels));
  m.density = TrainedNet(initial_weights(density_net_layout(levels), options.seed, kDensityNetStream));
  m.luminance = TrainedNet(initial_weights(luminance_net_layout(), options.seed, kLuminanceNetStream));
  const auto weights = std::size_t(field_weight_count(levels));
  m.forward = {weights, "nets"};
  m.backward = {weights, "nets"};
  m.last_layer = {kHiddenWidth, "nets"};
  m.d_weights = {weights * std::size_t(field_backward_blocks()), "nets"};

  m.state = {1, "nets"};
  m.places = {capacity_ * std::size_t(4), kSampleAdvice};
  m.gradients = {capacity_ * std::size_t(2), kSampleAdvice};
  m.encoded = {capacity_ * channels, kSampleAdvice};
  m.d_encoded = {capacity_ * std::size_t(4 * levels), kSampleAdvice};
  m.rays = {std::size_t(kMostRays), kRayAdvice};
  m.directions = {std::size_t(8 * kMostRays), kRayAdvice};

  m.cells = {occupancy_.densities().size(), "the occupancy grid; lower stage1.occupancy.resolution"};
  m.bits = {occupancy_.densities().size() / 32, "the occupancy grid; lower stage1.occupancy.resolution"};
  m.means = {std::size_t(options.cascades), "the occupancy grid"};

  counters_ = {0, first_rays(options.samples_per_step)};
  state_loaded();
}

LuminanceEngineCuda::~LuminanceEngineCuda() = default;

FieldView LuminanceEngineCuda::field() const {
  const Memory& m = *memory_;
  return {m.grid.levels().data(),
          int(m.grid.levels().size()),
          m.grid.table(),
          {{reinterpret_cast<const uint2*>(m.forward.data()), reinterpret_cast<const uint2*>(m.backward.data())},
           m.last_layer.data()},
          density_scale_,
          activation_};
}

TraceJob LuminanceEngineCuda::job(const MarchSettings& march, float min_transmittance) const {
  TraceJob job{};
  job.field = field();
  job.layout = OccupancyLayout(options_.occupancy.resolution, options_.cascades);
  job.occupied = memory_->bits.data();
  job.march = march;
  job.min_transmittance = min_transmittance;
  return job;
}

// The parts of a step -----------------------------------------------------------------------------------------------

void LuminanceEngineCuda::draw(cudaStream_t stream) {
  const Memory& m = *memory_;
  begin_step(m.state.data(), m.learning_rates.on_device(), stream);
  DrawJob draw{m.state.data(),
               views_->records.data(),
               std::uint32_t(views_->records.size()),
               options_.sampling(),
               options_.seed,
               m.rays.data(),
               reinterpret_cast<DirectionCode*>(m.directions.data())};
  draw_training_rays(draw, stream);
}

void LuminanceEngineCuda::follow_rays(cudaStream_t stream) {
  const Memory& m = *memory_;
  TraceJob trace = job(options_.march, kTrainingTransmittance);
  trace.rays = m.rays.data();
  trace.directions = reinterpret_cast<const DirectionCode*>(m.directions.data());
  trace.state = m.state.data();
  trace.samples = {capacity_, reinterpret_cast<float4*>(m.places.data()), reinterpret_cast<uint4*>(m.encoded.data()),
                   reinterpret_cast<float2*>(m.gradients.data())};
  trace.distortion_weight = options_.distortion_weight;
  trace_training_rays(trace, stream);
}

void LuminanceEngineCuda::nets_backward(cudaStream_t stream) {
  const Memory& m = *memory_;
  field_backward({int(m.grid.levels().size()),
                  field().nets,
                  {&m.state.data()->samples, capacity_},
                  reinterpret_cast<const float4*>(m.places.data()),
                  reinterpret_cast<const DirectionCode*>(m.directions.data()),
                  reinterpret_cast<const uint4*>(m.encoded.data()),
                  reinterpret_cast<const float2*>(m.gradients.data()),
                  m.d_encoded.data(),
                  m.d_weights.data()},
                 stream);
}

void LuminanceEngineCuda::grid_backward(cudaStream_t stream) {
  const Memory& m = *memory_;
  m.grid.backward(reinterpret_cast<const float4*>(m.places.data()), {&m.state.data()->samples, capacity_},
                  m.d_encoded.data(), stream);
}

void LuminanceEngineCuda::update_nets(cudaStream_t stream, bool only_pack) {
  const Memory& m = *memory_;
  const FieldParameters parameters{m.density.weights(), m.luminance.weights(),
                                   reinterpret_cast<uint2*>(m.forward.data()),
                                   reinterpret_cast<uint2*>(m.backward.data()), m.last_layer.data()};
  update_layers(field_layers(int(m.grid.levels().size()), parameters), only_pack ? nullptr : m.d_weights.data(),
                field_backward_blocks(), &m.state.data()->adam, stream);
}

void LuminanceEngineCuda::update_table(cudaStream_t stream) {
  memory_->grid.update(&memory_->state.data()->adam, stream);
}

OccupancyCells LuminanceEngineCuda::occupancy_cells() const {
  const Memory& m = *memory_;
  return {OccupancyLayout(options_.occupancy.resolution, options_.cascades),
          options_.occupancy.decay,
          options_.occupancy.optical_thickness,
          m.cells.data(),
          m.means.data(),
          m.bits.data()};
}

void LuminanceEngineCuda::visit_occupancy(cudaStream_t stream) {
  update_occupancy(field(), occupancy_cells(), occupancy_update(steps_, options_.seed), stream);
  occupancy_is_old_ = true;
}

/// The nets' optimiser and the hash grid's backward pass need the same gradients and nothing of each other.
void LuminanceEngineCuda::launch_step() {
  const Memory& m = *memory_;
  draw(m.stream);
  follow_rays(m.stream);
  nets_backward(m.stream);
  CNERF_CUDA(cudaEventRecord(m.fork, m.stream));
  CNERF_CUDA(cudaStreamWaitEvent(m.side, m.fork, 0));
  update_nets(m.side, false);
  CNERF_CUDA(cudaEventRecord(m.join, m.side));
  grid_backward(m.stream);
  update_table(m.stream);
  CNERF_CUDA(cudaStreamWaitEvent(m.stream, m.join, 0));
  end_step(m.state.data(), std::uint32_t(options_.samples_per_step), capacity_, m.reports.on_device(), m.stream);
}

void LuminanceEngineCuda::capture_step() {
  Memory& m = *memory_;
  cudaGraph_t graph = nullptr;
  CNERF_CUDA(cudaStreamBeginCapture(m.stream, cudaStreamCaptureModeThreadLocal));
  launch_step();
  CNERF_CUDA(cudaStreamEndCapture(m.stream, &graph));
  CNERF_CUDA(cudaGraphInstantiate(&m.graph, graph, 0));
  CNERF_CUDA(cudaGraphDestroy(graph));
}

void LuminanceEngineCuda::reset_graph() {
  Memory& m = *memory_;
  m.wait();
  if (m.graph != nullptr) CNERF_CUDA(cudaGraphExecDestroy(m.graph));
  m.graph = nullptr;
}

void LuminanceEngineCuda::upload_views(const std::vector<TrainingView>& views) {
  CNERF_CHECK(!views.empty(), "no training views");
  if (views_ && views_->holds(views)) return;
  reset_graph();
  views_ = std::make_unique<Views>();
  views_->source = views;
  const auto plane = [&](const void* data, std::size_t bytes) -> const std::uint8_t* {
    if (bytes == 0) return nullptr;
    views_->planes.emplace_back(bytes, kImageAdvice);
    views_->planes.back().upload(static_cast<const std::uint8_t*>(data), bytes);
    return views_->planes.back().data();
  };
  const float* tables[2][3] = {};
  const auto decoded = [&](const MonoImage& image) {
    const bool is_deep = image.depth == PixelDepth::kU16;
    const float* own = nullptr;  // a view of an exposure of its own needs a table of its own
    const float*& table = image.exposure == 1 && image.haze == 0 ? tables[is_deep][int(image.transfer)] : own;
    if (table == nullptr) {
      std::vector<float> values(is_deep ? 65536 : 256);
      for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = image.evened(decode_transfer(image.transfer, float(i) / float(values.size() - 1)));
      }
      views_->tables.push_back(uploaded(values, kImageAdvice));
      table = views_->tables.back().data();
    }
    return table;
  };
  std::vector<ViewRecord> records;
  for (const TrainingView& view : views) {
    const MonoImage& image = *view.image;
    ViewRecord record{view.camera, image.width, image.height, image.depth};
    switch (image.depth) {
      case PixelDepth::kU8:
        record.pixels = plane(image.u8.data(), image.u8.size());
        record.decoded = decoded(image);
        break;
      case PixelDepth::kU16:
        record.pixels = plane(image.u16.data(), image.u16.size() * sizeof(std::uint16_t));
        record.decoded = decoded(image);
        break;
      case PixelDepth::kF32:
        if (image.exposure == 1 && image.haze == 0) {
          record.pixels = plane(image.f32.data(), image.f32.size() * sizeof(float));
        } else {
          std::vector<float> values = image.f32;
          for (float& value : values) value = image.evened(value);
          record.pixels = plane(values.data(), values.size() * sizeof(float));
        }
        break;
    }
    record.alpha = plane(image.alpha.data(), image.alpha.size());
    record.mask = plane(image.mask.data(), image.mask.size());
    records.push_back(record);
  }
  views_->records = uploaded(records, kImageAdvice);
}

StepReport LuminanceEngineCuda::step(const std::vector<TrainingView>& views, float learning_rate) {
  const std::lock_guard lock(mutex_);
  upload_views(views);
  Memory& m = *memory_;
  const long known = std::max(0L, steps_ - kMostAhead);
  if (steps_ >= kMostAhead) CNERF_CUDA(cudaEventSynchronize(m.done[known % kStepRing]));
  m.learning_rates[std::size_t(steps_ % kStepRing)] = learning_rate;
  if (updates_occupancy(steps_)) visit_occupancy(m.stream);
  if (!is_warm_) {
    launch_step();  // loads the kernels, which a capture must not do
    is_warm_ = true;
  } else {
    if (m.graph == nullptr) capture_step();
    CNERF_CUDA(cudaGraphLaunch(m.graph, m.stream));
  }
  CNERF_CUDA(cudaEventRecord(m.done[steps_ % kStepRing], m.stream));
  if (steps_ < kMostAhead) CNERF_CUDA(cudaEventSynchronize(m.done[steps_ % kStepRing]));
  ++steps_;
  const long reported = steps_ <= kMostAhead ? steps_ - 1 : known;
  const StepRecord& r = m.reports[std::size_t(reported % kStepRing)];
  return {r.loss, r.squared_error, r.rays, r.marched, r.trained};
}

StepReport LuminanceEngineCuda::finish() const {
  memory_->wait();
  const StepRecord& r = memory_->reports[std::size_t(std::max(0L, steps_ - 1) % kStepRing)];
  return {r.loss, r.squared_error, r.rays, r.marched, r.trained};
}

CudaGradients LuminanceEngineCuda::gradients(const std::vector<TrainingView>& views) {
  const std::lock_guard lock(mutex_);
  upload_views(views);
  Memory& m = *memory_;
  draw(m.stream);
  follow_rays(m.stream);
  nets_backward(m.stream);
  grid_backward(m.stream);
  m.wait();
  CudaGradients result;
  result.table = m.grid.gradient().downloaded();
  CNERF_CUDA(cudaMemset(m.grid.gradient().data(), 0, m.grid.gradient().bytes()));
  const StepState state = m.state.downloaded().front();
  result.report = {state.loss / state.rays, state.squared_error / state.rays, state.rays, std::size_t(state.marched),
                   std::min(state.samples, capacity_)};

  // From the parts of the blocks to the nets' own order: layers without the channels that pad the hash grid's.
  const std::vector<float> parts = m.d_weights.downloaded();
  const int levels = int(m.grid.levels().size()), channels = 4 * levels, padded = 16 * channel_tiles(levels);
  const auto count = std::size_t(field_weight_count(levels));
  std::vector<float> sums(count, 0.0f);
  for (std::size_t i = 0; i < parts.size(); ++i) sums[i % count] += parts[i];
  for (int out = 0; out < kHiddenWidth; ++out) {
    const auto row = sums.begin() + out * padded;
    result.weights.insert(result.weights.end(), row, row + channels);
  }
  result.weights.insert(result.weights.end(), sums.begin() + kHiddenWidth * padded, sums.end());
  result.weights.resize(m.density.size() + m.luminance.size(), 0.0f);  // outputs that pad the last layer
  return result;
}

CudaStepTimes LuminanceEngineCuda::time_parts(const std::vector<TrainingView>& views, int repetitions) {
  const std::lock_guard lock(mutex_);
  upload_views(views);
  Memory& m = *memory_;
  cudaEvent_t begin = nullptr, end = nullptr;
  CNERF_CUDA(cudaEventCreate(&begin));
  CNERF_CUDA(cudaEventCreate(&end));
  const auto timed = [&](double& total, auto&& work) {
    float milliseconds = 0;
    CNERF_CUDA(cudaEventRecord(begin, m.stream));
    work();
    CNERF_CUDA(cudaEventRecord(end, m.stream));
    CNERF_CUDA(cudaEventSynchronize(end));
    CNERF_CUDA(cudaEventElapsedTime(&milliseconds, begin, end));
    total += milliseconds / repetitions;
  };
  CudaStepTimes times;
  std::fill_n(&m.learning_rates[0], kStepRing, 0.0f);
  for (int i = 0; i < repetitions; ++i) {
    timed(times.draw, [&] { draw(m.stream); });
    timed(times.trace, [&] { follow_rays(m.stream); });
    timed(times.nets_backward, [&] { nets_backward(m.stream); });
    timed(times.nets_update, [&] { update_nets(m.stream, false); });
    timed(times.grid_backward, [&] { grid_backward(m.stream); });
    timed(times.table_update, [&] { update_table(m.stream); });
    timed(times.occupancy, [&] { visit_occupancy(m.stream); });
  }
  cudaEventDestroy(begin);
  cudaEventDestroy(end);
  return times;
}

// Rendering and queries ---------------------------------------------------------------------------------------------

void LuminanceEngineCuda::start_trace(std::uint32_t rays) const {
  Memory& m = *memory_;
  if (m.trace_rays.size() < rays) {
    m.wait();
    m.trace_state = {1, kRayAdvice};
    m.trace_rays = {rays, kRayAdvice};
    m.trace_directions = {rays * std::size_t(8), kRayAdvice};
  }
  StepState state;
  state.rays = rays;
  CNERF_CUDA(cudaMemcpyAsync(m.trace_state.data(), &state, sizeof(state), cudaMemcpyHostToDevice, m.stream));
}

TraceJob LuminanceEngineCuda::job_of_rays(std::span<const Ray> rays, const MarchSettings& march,
                                          float min_transmittance) const {
  Memory& m = *memory_;
  const auto count = std::uint32_t(rays.size());
  if (m.plain_rays.size() < count) m.plain_rays = {count, kRayAdvice};
  start_trace(count);
  CNERF_CUDA(cudaMemcpyAsync(m.plain_rays.data(), rays.data(), rays.size_bytes(), cudaMemcpyHostToDevice, m.stream));
  auto* directions = reinterpret_cast<DirectionCode*>(m.trace_directions.data());
  prepare_rays(m.plain_rays.data(), count, m.trace_rays.data(), directions, m.stream);
  TraceJob trace = job(march, min_transmittance);
  trace.rays = m.trace_rays.data();
  trace.directions = directions;
  trace.state = m.trace_state.data();
  return trace;
}

void LuminanceEngineCuda::render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                                 std::span<RayResult> results) const {
  CNERF_CHECK_EQ(rays.size(), results.size());
  const std::lock_guard lock(mutex_);
  Memory& m = *memory_;
  const auto most = std::uint32_t(std::min<std::size_t>(rays.size(), kRaysAtATime));
  if (m.results.size() < most) m.results = {most, kRayAdvice};
  for (std::size_t first = 0; first < rays.size(); first += most) {
    const auto count = std::uint32_t(std::min<std::size_t>(most, rays.size() - first));
    TraceJob trace = job_of_rays(rays.subspan(first, count), march, effort.min_transmittance);
    trace.results = m.results.data();
    render_rays(trace, m.stream);
    CNERF_CUDA(cudaMemcpyAsync(results.data() + first, m.results.data(), count * sizeof(RayResult),
                               cudaMemcpyDeviceToHost, m.stream));
    m.wait();
  }
}

void LuminanceEngineCuda::render_view(const UnitCamera& camera, const MarchSettings& march, float min_transmittance,
                                      std::span<RayResult> results) const {
  const std::lock_guard lock(mutex_);
  Memory& m = *memory_;
  const auto count = std::uint32_t(camera.intrinsics.width) * std::uint32_t(camera.intrinsics.height);
  CNERF_CHECK(results.empty() || results.size() == count, "one result a pixel");
  if (m.results.size() < count) m.results = {count, kRayAdvice};
  start_trace(count);
  auto* directions = reinterpret_cast<DirectionCode*>(m.trace_directions.data());
  camera_rays(camera, 0, count, m.trace_rays.data(), directions, m.stream);
  TraceJob trace = job(march, min_transmittance);
  trace.rays = m.trace_rays.data();
  trace.directions = directions;
  trace.state = m.trace_state.data();
  trace.results = m.results.data();
  render_rays(trace, m.stream);
  if (!results.empty()) {
    CNERF_CUDA(
        cudaMemcpyAsync(results.data(), m.results.data(), count * sizeof(RayResult), cudaMemcpyDeviceToHost, m.stream));
  }
  m.wait();
}

void LuminanceEngineCuda::trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                                std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const {
  const std::lock_guard lock(mutex_);
  Memory& m = *memory_;
  samples.clear();
  offsets.assign(1, 0);
  std::uint32_t most = 1 << 14;
  const std::size_t room = std::size_t(1) << 22;
  if (m.weighted.size() < room) m.weighted = {room, kRayAdvice};
  if (m.traced.size() < most) m.traced = {most, kRayAdvice};
  if (!m.found) m.found = std::make_unique<MappedBuffer<WeightedSample>>(room);
  for (std::size_t first = 0; first < rays.size();) {
    const auto count = std::uint32_t(std::min<std::size_t>(most, rays.size() - first));
    TraceJob trace = job_of_rays(rays.subspan(first, count), march, effort.min_transmittance);
    trace.weighted = m.weighted.data();
    trace.weighted_capacity = std::uint32_t(m.weighted.size());
    trace.traced = m.traced.data();
    trace_to_samples(trace, m.stream);
    m.wait();
    const StepState state = m.trace_state.downloaded().front();
    if (state.samples > trace.weighted_capacity) {
      most = count / 2;  // too many samples: fewer rays at a time
      continue;
    }
    m.weighted.download(&(*m.found)[0], state.samples, m.stream);
    std::vector<TracedRay> of_rays(count);
    m.traced.download(of_rays.data(), count);
    m.wait();
    append_heaviest(of_rays, &(*m.found)[0], effort, samples, offsets);
    if (first == 0) samples.reserve(samples.size() * (rays.size() / count + 1));  // as many a ray: hardly ever moves
    first += count;
  }
}

std::size_t LuminanceEngineCuda::points_at_a_time() const {
  return kPointsAtATime;
}

void LuminanceEngineCuda::query_density(std::span<const Vec3f> positions, std::span<float> sigma) const {
  CNERF_CHECK_EQ(positions.size(), sigma.size());
  const std::lock_guard lock(mutex_);
  Memory& m = *memory_;
  const std::size_t most = std::min<std::size_t>(positions.size(), kPointsAtATime);
  if (m.points.size() < most) m.points = {most, "points"};
  if (m.answers.size() < most) m.answers = {most, "points"};
  for (std::size_t first = 0; first < positions.size(); first += most) {
    const std::size_t count = std::min(most, positions.size() - first);
    CNERF_CUDA(cudaMemcpyAsync(m.points.data(), positions.data() + first, count * sizeof(Vec3f), cudaMemcpyHostToDevice,
                               m.stream));
    query_field(field(), m.points.data(), nullptr, std::uint32_t(count), m.answers.data(), nullptr, m.stream);
    CNERF_CUDA(cudaMemcpyAsync(sigma.data() + first, m.answers.data(), count * sizeof(float), cudaMemcpyDeviceToHost,
                               m.stream));
    m.wait();
  }
}

void LuminanceEngineCuda::query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                                          std::span<float> luminance) const {
  CNERF_CHECK_EQ(positions.size(), luminance.size());
  CNERF_CHECK_EQ(positions.size(), directions.size());
  const std::lock_guard lock(mutex_);
  Memory& m = *memory_;
  const std::size_t most = std::min<std::size_t>(positions.size(), kPointsAtATime);
  if (m.points.size() < most) m.points = {most, "points"};
  if (m.point_directions.size() < most) m.point_directions = {most, "points"};
  if (m.answers.size() < most) m.answers = {most, "points"};
  for (std::size_t first = 0; first < positions.size(); first += most) {
    const std::size_t count = std::min(most, positions.size() - first);
    CNERF_CUDA(cudaMemcpyAsync(m.points.data(), positions.data() + first, count * sizeof(Vec3f), cudaMemcpyHostToDevice,
                               m.stream));
    CNERF_CUDA(cudaMemcpyAsync(m.point_directions.data(), directions.data() + first, count * sizeof(Vec3f),
                               cudaMemcpyHostToDevice, m.stream));
    query_field(field(), m.points.data(), m.point_directions.data(), std::uint32_t(count), nullptr, m.answers.data(),
                m.stream);
    CNERF_CUDA(cudaMemcpyAsync(luminance.data() + first, m.answers.data(), count * sizeof(float),
                               cudaMemcpyDeviceToHost, m.stream));
    m.wait();
  }
}

// State -------------------------------------------------------------------------------------------------------------

void LuminanceEngineCuda::fetch_occupancy() const {
  if (!occupancy_is_old_) return;
  memory_->wait();
  memory_->cells.download(occupancy_.densities().data(), occupancy_.densities().size());
  occupancy_.refresh_bits();
  occupancy_is_old_ = false;
}

const OccupancyGrid& LuminanceEngineCuda::occupancy() const {
  if (!occupancy_is_old_) return occupancy_;  // asked for every point of a bake
  const std::lock_guard lock(mutex_);
  fetch_occupancy();
  return occupancy_;
}

void LuminanceEngineCuda::exclude(const std::function<bool(Vec3f, float)>& wanted) {
  occupancy_.exclude(wanted);
  const Memory& m = *memory_;
  m.cells.upload(occupancy_.densities().data(), occupancy_.densities().size());
  refresh_occupancy_bits(occupancy_cells(), m.stream);
  m.wait();
}

std::vector<StatePiece> LuminanceEngineCuda::state() {
  const std::lock_guard lock(mutex_);
  Memory& m = *memory_;
  m.wait();
  fetch_occupancy();
  counters_ = {steps_, m.state.downloaded().front().rays};

  std::vector<StatePiece> state;
  m.grid.append_state("grid", state);
  m.density.append_state("density_net", state);
  m.luminance.append_state("luminance_net", state);
  state.push_back(state_piece("occupancy", occupancy_.densities()));
  state.push_back(state_piece("counters", counters_));
  return state;
}

void LuminanceEngineCuda::state_loaded() {
  const std::lock_guard lock(mutex_);
  const Memory& m = *memory_;
  m.wait();
  m.grid.upload(m.stream);
  m.density.upload();
  m.luminance.upload();
  steps_ = long(counters_[0]);
  StepState state;
  state.step = counters_[0];
  state.rays = std::uint32_t(counters_[1]);
  m.state.upload(&state, 1);
  m.cells.upload(occupancy_.densities().data(), occupancy_.densities().size());
  occupancy_.refresh_bits();
  occupancy_is_old_ = false;
  update_nets(m.stream, true);
  refresh_occupancy_bits(occupancy_cells(), m.stream);
  m.wait();
}

std::size_t LuminanceEngineCuda::device_bytes() const {
  std::size_t total = 0;
  memory_->for_each_buffer([&](const auto& buffer) { total += buffer.bytes(); });
  if (views_) {
    for (const auto& plane : views_->planes) total += plane.bytes();
    for (const auto& table : views_->tables) total += table.bytes();
  }
  return total;
}

bool has_cuda_device() {
  int devices = 0;
  const bool found = cudaGetDeviceCount(&devices) == cudaSuccess && devices > 0;
  cudaGetLastError();
  return found;
}

std::string cuda_device_text() {
  int device = 0;
  cudaDeviceProp properties{};
  CNERF_CUDA(cudaGetDevice(&device));
  CNERF_CUDA(cudaGetDeviceProperties(&properties, device));
  return std::string(properties.name) + ", " + std::to_string(properties.totalGlobalMem >> 30) + " GiB";
}

std::unique_ptr<LuminanceEngine> make_cuda_luminance_engine(const LuminanceEngineOptions& options) {
  if (!has_cuda_device()) throw DeviceError("no CUDA device: no driver, or no GPU it can use");
  return std::make_unique<LuminanceEngineCuda>(options);
}

}  // namespace cnerf
