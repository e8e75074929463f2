// The engine of stage 1 on the GPU.

#include <atomic>
#include <cmath>
#include <mutex>

#include "src/base/check.h"
#include "src/engine/cuda/luminance_step.h"
#include "src/engine/cuda/luminance_tracer.h"
#include "src/engine/stage1_schedule.h"

namespace cnerf {
namespace {

const char* const kGridAdvice = "the occupancy grid; lower stage1.occupancy.resolution";

/// The occupancy grid in device memory.
struct OccupancyMemory {
  DeviceBuffer<float> density;
  DeviceBuffer<MeanDensity<double>> means;
  DeviceBuffer<std::uint32_t> bits;

  OccupancyMemory(std::size_t cells, int cascades)
      : density(cells, kGridAdvice), means(std::size_t(cascades), kGridAdvice), bits(cells / 32, kGridAdvice) {}
};

class LuminanceEngineCuda final : public LuminanceEngine {
 public:
  explicit LuminanceEngineCuda(const LuminanceEngineOptions& options)
      : options_(options),
        field_(options.grid, 1.0f / std::ldexp(1.0f, 1 - options.cascades), options.max_luminance,
               sample_capacity(options), options.seed),
        step_(options, field_, stream_),
        occupancy_(options.occupancy, options.cascades),
        occupancy_memory_(occupancy_.densities().size(), options.cascades),
        tracer_({options.occupancy.resolution, options.cascades}, occupancy_memory_.bits.data(), stream_),
        counters_{0, first_rays(options.samples_per_step)},
        corrections_(std::size_t(options.learning.views)),
        correction_moments_(std::size_t(options.learning.views)),
        lenses_(std::size_t(options.learning.lenses)),
        lens_moments_(std::size_t(options.learning.lenses)) {
    state_loaded();
  }

  void limit_image_memory(std::size_t bytes) override {
    const std::lock_guard lock(mutex_);
    step_.limit_image_memory(bytes);
  }
  void set_views(const std::vector<TrainingView>& views) override {
    CNERF_CHECK(!views.empty(), "no training views");
    const std::lock_guard lock(mutex_);
    step_.set_views(views);
  }
  void share_steps(const StepShare& share) override {
    const std::lock_guard lock(mutex_);
    step_.share(share);
  }
  void complete_state() override {
    const std::lock_guard lock(mutex_);
    step_.complete_state();
  }
  StepReport step(float learning_rate) override {
    const std::lock_guard lock(mutex_);
    if (updates_occupancy(step_.steps())) {
      update_occupancy(field_.view(), occupancy_cells(), occupancy_update(step_.steps(), options_.seed), stream_);
      occupancy_is_old_ = true;
    }
    return step_.run(learning_rate, occupancy_memory_.bits.data());
  }
  [[nodiscard]] long step_count() const override { return step_.steps(); }
  [[nodiscard]] std::vector<ViewCorrection> view_corrections() const override {
    const std::lock_guard lock(mutex_);
    stream_.wait();
    return step_.corrections();
  }
  [[nodiscard]] std::vector<LensCorrection> lens_corrections() const override {
    const std::lock_guard lock(mutex_);
    stream_.wait();
    return step_.lenses();
  }

  void render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
              std::span<RayResult> results) const override {
    CNERF_CHECK_EQ(rays.size(), results.size());
    const std::lock_guard lock(mutex_);
    tracer_.render(field_.view(), rays, march, effort, results);
  }
  void render_view(const UnitCamera& camera, const MarchSettings& march, const RenderEffort& effort,
                   std::span<RayResult> results) const override {
    CNERF_CHECK(results.empty() ||
                    results.size() == std::size_t(camera.intrinsics.width) * std::size_t(camera.intrinsics.height),
                "one result per pixel");
    const std::lock_guard lock(mutex_);
    tracer_.render_view(field_.view(), camera, march, effort, results);
  }
  void trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
             std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const override {
    const std::lock_guard lock(mutex_);
    tracer_.trace(field_.view(), rays, march, effort, samples, offsets);
  }
  [[nodiscard]] std::unique_ptr<TracedPixels> trace_pixels(std::span<const Ray> rays, const MarchSettings& march,
                                                           const RenderEffort& effort) const override {
    const std::lock_guard lock(mutex_);
    return tracer_.trace_pixels(field_.view(), rays, march, effort);
  }
  [[nodiscard]] std::size_t rays_at_a_time() const override { return LuminanceTracerCuda::kTracedAtATime; }
  [[nodiscard]] std::size_t points_at_a_time() const override { return LuminanceTracerCuda::kPointsAtATime; }
  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override {
    const std::lock_guard lock(mutex_);
    tracer_.query(field_.view(), positions, {}, sigma);
  }
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override {
    CNERF_CHECK_EQ(positions.size(), directions.size());
    const std::lock_guard lock(mutex_);
    tracer_.query(field_.view(), positions, directions, luminance);
  }

  [[nodiscard]] const OccupancyGrid& occupancy() const override {
    if (!occupancy_is_old_) return occupancy_;  // asked for every point of a bake
    const std::lock_guard lock(mutex_);
    fetch_occupancy();
    return occupancy_;
  }
  void exclude(const std::function<bool(Vec3f, float)>& wanted) override {
    const std::lock_guard lock(mutex_);
    occupancy_.exclude(wanted);
    upload_occupancy();
    stream_.wait();
  }

  [[nodiscard]] std::vector<StatePiece> state() override {
    const std::lock_guard lock(mutex_);
    stream_.wait();
    fetch_occupancy();
    counters_ = {step_.steps(), step_.rays()};
    std::vector<StatePiece> state;
    field_.append_state(state);
    state.push_back(state_piece("occupancy", occupancy_.densities()));
    state.push_back(state_piece("counters", counters_));
    if (options_.learning.is_on()) {
      corrections_ = step_.corrections();
      correction_moments_ = step_.correction_moments();
      state.push_back(state_piece("views", corrections_));
      state.push_back(state_piece("views.moments", correction_moments_));
    }
    if (options_.learning.lenses > 0) {
      lenses_ = step_.lenses();
      lens_moments_ = step_.lens_moments();
      state.push_back(state_piece("lenses", lenses_));
      state.push_back(state_piece("lenses.moments", lens_moments_));
    }
    return state;
  }
  void state_loaded() override {
    const std::lock_guard lock(mutex_);
    stream_.wait();
    field_.upload(stream_);
    step_.restart(long(counters_[0]), counters_[1]);
    step_.set_learned(corrections_, correction_moments_);
    step_.set_lenses(lenses_, lens_moments_);
    occupancy_.refresh_bits();
    occupancy_is_old_ = false;
    upload_occupancy();
    stream_.wait();
  }

 private:
  [[nodiscard]] OccupancyCells occupancy_cells() const {
    const OccupancyOptions& options = options_.occupancy;
    return {{options.resolution, options_.cascades},
            options.decay,
            options.optical_thickness,
            occupancy_memory_.density.data(),
            occupancy_memory_.means.data(),
            occupancy_memory_.bits.data()};
  }
  void fetch_occupancy() const {
    if (!occupancy_is_old_) return;
    stream_.wait();
    occupancy_memory_.density.download(occupancy_.densities().data(), occupancy_.densities().size());
    occupancy_.refresh_bits();
    occupancy_is_old_ = false;
  }
  void upload_occupancy() const {
    occupancy_memory_.density.upload(occupancy_.densities().data(), occupancy_.densities().size());
    refresh_occupancy_bits(occupancy_cells(), stream_);
  }

  LuminanceEngineOptions options_;
  CudaStream stream_;
  LuminanceFieldCuda field_;
  LuminanceStepCuda step_;
  // What the host knows of the GPU's grid, brought up to date when asked for.
  mutable OccupancyGrid occupancy_;
  OccupancyMemory occupancy_memory_;
  mutable std::atomic<bool> occupancy_is_old_ = false;
  mutable LuminanceTracerCuda tracer_;
  std::vector<std::int64_t> counters_;       // steps done, rays of the next step
  std::vector<ViewCorrection> corrections_;  // as the last call of `state` or `state_loaded` left them
  std::vector<ViewMoments> correction_moments_;
  std::vector<LensCorrection> lenses_;  // likewise
  std::vector<LensMoments> lens_moments_;
  mutable std::mutex mutex_;  // queries come from many threads
};

}  // namespace

bool has_cuda_device() {
  constexpr int kSharedMemory = 150'000;  // bytes that a block of the largest kernels takes
  int devices = 0, device = 0, major = 0, shared = 0;
  const bool found = cudaGetDeviceCount(&devices) == cudaSuccess && devices > 0 &&
                     cudaGetDevice(&device) == cudaSuccess &&
                     cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device) == cudaSuccess &&
                     cudaDeviceGetAttribute(&shared, cudaDevAttrMaxSharedMemoryPerBlockOptin, device) == cudaSuccess;
  cudaGetLastError();
  return found && major >= 8 && shared >= kSharedMemory;
}

std::string cuda_device_text() {
  int device = 0;
  cudaDeviceProp properties{};
  CNERF_CUDA(cudaGetDevice(&device));
  CNERF_CUDA(cudaGetDeviceProperties(&properties, device));
  return std::string(properties.name) + ", " + std::to_string(properties.totalGlobalMem >> 30) + " GiB";
}

std::unique_ptr<LuminanceEngine> make_cuda_luminance_engine(const LuminanceEngineOptions& options) {
  return std::make_unique<LuminanceEngineCuda>(options);
}

}  // namespace cnerf
