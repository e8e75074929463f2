#include "src/compare/remembered_rays.h"

#include "src/base/files.h"

namespace cnerf::compare {
namespace {

class RememberingEngine final : public LuminanceEngine {
 public:
  RememberingEngine(std::unique_ptr<LuminanceEngine> inner, std::shared_ptr<RayMemory> memory)
      : inner_(std::move(inner)), memory_(std::move(memory)) {}

  void trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
             std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const override {
    RayMemory::Trace trace = memory_->trace(*inner_, rays, march, effort);
    samples = std::move(trace.samples);
    offsets = std::move(trace.offsets);
  }

  void set_views(const std::vector<TrainingView>& views) override { inner_->set_views(views); }
  StepReport step(float learning_rate) override { return inner_->step(learning_rate); }
  [[nodiscard]] long step_count() const override { return inner_->step_count(); }
  void render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
              std::span<RayResult> results) const override {
    inner_->render(rays, march, effort, results);
  }
  void render_view(const UnitCamera& camera, const MarchSettings& march, const RenderEffort& effort,
                   std::span<RayResult> results) const override {
    inner_->render_view(camera, march, effort, results);
  }
  [[nodiscard]] std::size_t points_at_a_time() const override { return inner_->points_at_a_time(); }
  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override {
    inner_->query_density(positions, sigma);
  }
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override {
    inner_->query_luminance(positions, directions, luminance);
  }
  [[nodiscard]] const OccupancyGrid& occupancy() const override { return inner_->occupancy(); }
  void exclude(const std::function<bool(Vec3f, float)>& wanted) override { inner_->exclude(wanted); }
  [[nodiscard]] std::vector<StatePiece> state() override { return inner_->state(); }
  void state_loaded() override { inner_->state_loaded(); }

 private:
  std::unique_ptr<LuminanceEngine> inner_;
  std::shared_ptr<RayMemory> memory_;
};

}  // namespace

RayMemory::Trace RayMemory::trace(const LuminanceEngine& engine, std::span<const Ray> rays, const MarchSettings& march,
                                  const RenderEffort& effort) {
  const float settings[] = {march.dt_min, march.dt_max, march.cone_angle, effort.min_transmittance,
                            effort.shaded_share};
  const std::string key = sha256(std::as_bytes(rays)) + sha256(std::as_bytes(std::span(settings)));
  if (const auto known = traces_.find(key); known != traces_.end()) return known->second;
  Trace trace;
  engine.trace(rays, march, effort, trace.samples, trace.offsets);
  if (trace.samples.size() <= left_) {
    left_ -= trace.samples.size();
    traces_.emplace(key, trace);
  }
  return trace;
}

std::unique_ptr<LuminanceEngine> RememberingEngines::make_luminance(const LuminanceEngineOptions& options) const {
  return std::make_unique<RememberingEngine>(inner_.make_luminance(options), memory_);
}

}  // namespace cnerf::compare
