#pragma once
/// The CPU engine of stage 1. Rays are worked on in blocks of 16, whose samples and activations stay in L2.

#include <tbb/enumerable_thread_specific.h>

#include <memory>
#include <vector>

#include "src/engine/cpu/luminance_field.h"
#include "src/engine/luminance_engine.h"
#include "src/render/observed_ray.h"

namespace cnerf {

class LuminanceEngineCpu final : public LuminanceEngine {
 public:
  explicit LuminanceEngineCpu(const LuminanceEngineOptions& options);

  StepReport step(const std::vector<TrainingView>& views, float learning_rate) override;
  [[nodiscard]] long step_count() const override { return counters_.front(); }

  void render(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
              std::span<RayResult> results) const override;
  void trace(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
             std::vector<WeightedSample>& samples, std::vector<std::size_t>& offsets) const override;
  void query_density(std::span<const Vec3f> positions, std::span<float> sigma) const override;
  void query_luminance(std::span<const Vec3f> positions, std::span<const Vec3f> directions,
                       std::span<float> luminance) const override;
  [[nodiscard]] const OccupancyGrid& occupancy() const override { return occupancy_; }
  void exclude(const std::function<bool(Vec3f, float)>& wanted) override { occupancy_.exclude(wanted); }
  [[nodiscard]] std::vector<StatePiece> state() override;
  void state_loaded() override;

  /// The rays of the next step: a pure function of the step number.
  [[nodiscard]] ObservedRay observe(const std::vector<TrainingView>& views, std::size_t ray) const {
    return observe_ray(views, options_.sampling(), options_.seed, std::uint64_t(step_count()), ray);
  }

  /// Gradients of one step without applying them, for tests.
  struct Gradients {
    std::vector<float> table;    ///< [rows, 4]
    std::vector<float> weights;  ///< density net, then luminance net
    StepReport report;
  };
  Gradients gradients(const std::vector<TrainingView>& views);
  [[nodiscard]] const LuminanceFieldCpu& field() const { return field_; }
  [[nodiscard]] const LuminanceEngineOptions& options() const { return options_; }

 private:
  static constexpr std::size_t kBlockRays = 16;
  static constexpr std::size_t kChunks = 32;  // parts of a step whose sums are added in order, for any thread count

  /// A step of a ray, and the weight that the density-first pass found.
  struct MarchedSample {
    float t = 0, dt = 0, weight = 0;
  };
  /// Samples of a block's rays that survive early termination, ray by ray.
  struct Block {
    std::vector<MarchedSample> samples;
    std::vector<std::size_t> offsets;  // [rays + 1]
    std::size_t marched = 0;
    AlignedVector<float> positions;  // [G, 3, 16]
    LuminanceWorkspace work;
    // Scratch of the density-first pass.
    std::vector<std::vector<MarchedSample>> of_ray;
    AlignedVector<float> wave_positions, wave_sigma;
  };
  /// What one chunk of a step adds up.
  struct Chunk {
    AlignedVector<float> positions, d_encoded;
    std::size_t groups = 0;
    std::vector<float> d_weights;
    double loss = 0, squared_error = 0;
    std::size_t marched = 0, trained = 0;
  };

  /// Marches rays together and keeps the samples in front of the point where a ray becomes opaque: densities are
  /// computed in waves of a few samples a ray, so that hidden samples cost next to nothing.
  void collect(std::span<const Ray> rays, std::span<const float> jitter, const MarchSettings& march,
               float min_transmittance, Block& block) const;
  /// `collect` from the middle of each step, and of what it keeps the heaviest samples.
  void collect_for_picture(std::span<const Ray> rays, const MarchSettings& march, const RenderEffort& effort,
                           Block& block) const;
  void shade(std::span<const Ray> rays, Block& block) const;
  void train_block(std::span<const ObservedRay> rays, float gradient_scale, Block& block, Chunk& chunk) const;
  void accumulate(const std::vector<TrainingView>& views);
  [[nodiscard]] StepReport report() const;

  LuminanceEngineOptions options_;
  LuminanceFieldCpu field_;
  OccupancyGrid occupancy_;
  std::vector<std::int64_t> counters_;  // steps done, rays of the next step
  std::vector<Chunk> chunks_;
  mutable tbb::enumerable_thread_specific<Block> blocks_;
};

}  // namespace cnerf
