#pragma once
/// An engine that was never trained: a wall with a smooth pattern, and fog before it that may be asked for.

#include <cmath>
#include <stdexcept>

#include "src/engine/luminance_engine.h"

namespace cnerf::test {

class AnalyticEngine : public LuminanceEngine {
 public:
  /// @param fog  opacity of what hangs a twentieth of a side before each camera
  explicit AnalyticEngine(float fog = 0) : fog_(fog) {}

  /// Of the wall, which is the plane z = 0.5.
  [[nodiscard]] static float light_at(float x, float y) {
    return 0.4f + 0.15f * std::sin(23 * x + 5 * y) + 0.15f * std::sin(29 * y - 7 * x) + 0.05f * std::sin(61 * x * y);
  }

  void render(std::span<const Ray> rays, const MarchSettings&, const RenderEffort&,
              std::span<RayResult> results) const override {
    for (std::size_t r = 0; r < rays.size(); ++r) {
      const float t = way_to_wall(rays[r]);
      const Vec3f at = rays[r].at(t);
      results[r] = {};
      results[r].luminance = (1 - fog_) * light_at(at.x, at.y);
      results[r].opacity = 1;
      results[r].depth = t;
    }
  }
  void trace(std::span<const Ray> rays, const MarchSettings&, const RenderEffort&, std::vector<WeightedSample>& samples,
             std::vector<std::size_t>& offsets) const override {
    samples.clear();
    offsets = {0};
    for (const Ray& ray : rays) {
      samples.push_back({0.05f, fog_, 0});
      samples.push_back({way_to_wall(ray), 1 - fog_, 0.5f});
      offsets.push_back(samples.size());
    }
  }

  void set_views(const std::vector<TrainingView>&) override { not_here(); }
  StepReport step(float) override { not_here(); }
  [[nodiscard]] long step_count() const override { return 0; }
  void query_density(std::span<const Vec3f>, std::span<float>) const override { not_here(); }
  void query_luminance(std::span<const Vec3f>, std::span<const Vec3f>, std::span<float>) const override { not_here(); }
  [[nodiscard]] const OccupancyGrid& occupancy() const override { not_here(); }
  void exclude(const std::function<bool(Vec3f, float)>&) override { not_here(); }
  [[nodiscard]] std::vector<StatePiece> state() override { not_here(); }
  void state_loaded() override { not_here(); }

 private:
  [[noreturn]] static void not_here() { throw std::logic_error("an engine without a field"); }
  [[nodiscard]] static float way_to_wall(const Ray& ray) { return (0.5f - ray.origin.z) / ray.direction.z; }

  float fog_;
};

}  // namespace cnerf::test
