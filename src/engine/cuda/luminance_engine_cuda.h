#pragma once
/// The CUDA engine of stage 1. A step is one graph of kernels: draw rays, follow them (march, hash grid, nets, loss and
/// its gradient), nets backward, hash grid backward, Adam. The host only says the learning rate and never waits for a
/// step, except that it keeps no more than a few ahead.

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "src/base/cuda/device_memory.h"
#include "src/engine/cuda/step_kernels.h"
#include "src/engine/cuda/trace_kernel.h"
#include "src/engine/luminance_engine.h"

namespace cnerf {

struct DirectionCode;

/// A gradient of one step without applying it, for tests.
struct CudaGradients {
  std::vector<float> table;    ///< [rows, 4]
  std::vector<float> weights;  ///< density net, then luminance net, as mlp_layout.h orders them
  StepReport report;
};

/// Mean times of a step's parts, in milliseconds, for benchmarks.
struct CudaStepTimes {
  double draw = 0, trace = 0, nets_backward = 0, grid_backward = 0, nets_update = 0, table_update = 0, occupancy = 0;
};

class LuminanceEngineCuda final : public LuminanceEngine {
 public:
  /// @throws DeviceError  without a usable GPU, or when its memory does not suffice
  explicit LuminanceEngineCuda(const LuminanceEngineOptions& options);
  ~LuminanceEngineCuda() override;

  /// The report is of the latest step that is known to be done, at most a few steps ago.
  StepReport step(const std::vector<TrainingView>& views, float learning_rate) override;
  [[nodiscard]] long step_count() const override { return steps_; }

  void render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
              std::span<RayResult> results) const override;
  void trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
             std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const override;
  [[nodiscard]] std::size_t points_at_a_time() const override;
  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override;
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override;
  [[nodiscard]] const OccupancyGrid& occupancy() const override;
  void exclude(const std::function<bool(Vec3f, float)>& wanted) override;
  [[nodiscard]] std::vector<StatePiece> state() override;
  void state_loaded() override;

  /// Waits until every step is done; returns the last one's report.
  StepReport finish() const;
  /// Renders a view whose rays are made on the GPU.
  /// @param results  [height, width]; may be empty, for timing
  void render_view(const UnitCamera& camera, const MarchSettings& march, float min_transmittance,
                   std::span<RayResult> results) const;
  /// What the next step would do.
  CudaGradients gradients(const std::vector<TrainingView>& views);
  /// Times the parts of steps on their own, one after another, without training.
  CudaStepTimes time_parts(const std::vector<TrainingView>& views, int repetitions);
  /// GPU memory of this engine, images included.
  [[nodiscard]] std::size_t device_bytes() const;

 private:
  struct Memory;
  struct Views;

  void upload_views(const std::vector<TrainingView>& views);
  void visit_occupancy(cudaStream_t stream);
  void fetch_occupancy() const;
  void draw(cudaStream_t stream);
  void follow_rays(cudaStream_t stream);
  void nets_backward(cudaStream_t stream);
  void grid_backward(cudaStream_t stream);
  void update_nets(cudaStream_t stream, bool only_pack);
  void update_table(cudaStream_t stream);
  void launch_step();
  void capture_step();
  void reset_graph();

  [[nodiscard]] FieldView field() const;
  [[nodiscard]] OccupancyCells occupancy_cells() const;
  [[nodiscard]] TraceJob job(const MarchSettings& march, float min_transmittance) const;
  void start_trace(std::uint32_t rays) const;
  /// Uploads rays and makes a job that traces them; what the job answers with is still to be set.
  [[nodiscard]] TraceJob job_of_rays(std::span<const Ray> rays, const MarchSettings& march,
                                     float min_transmittance) const;

  LuminanceEngineOptions options_;
  std::uint32_t capacity_ = 0;
  float density_scale_ = 1;
  LuminanceActivation<float> activation_;
  long steps_ = 0;
  bool is_warm_ = false;  // every kernel of a step has run once
  std::unique_ptr<Memory> memory_;
  std::unique_ptr<Views> views_;

  // What the host knows of the GPU's state, when asked for it.
  mutable OccupancyGrid occupancy_;
  mutable std::atomic<bool> occupancy_is_old_ = false;
  std::vector<std::int64_t> counters_;  // steps done, rays of the next step
  mutable std::mutex mutex_;            // queries come from many threads
};

}  // namespace cnerf
