#pragma once
/// Takes of one stage 1 are rendered from the same cameras: what their rays meet is traced once.

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "src/engine/engines.h"

namespace cnerf::compare {

/// What traced rays met.
class RayMemory {
 public:
  struct Trace {
    std::vector<WeightedSample> samples;
    std::vector<std::size_t> offsets;
  };
  /// @param most_samples  rays beyond that many samples (12 bytes each) are not kept
  explicit RayMemory(std::size_t most_samples = std::size_t(1) << 27) : left_(most_samples) {}

  /// What `engine` traces, or has traced.
  [[nodiscard]] Trace trace(const LuminanceEngine& engine, std::span<const Ray> rays, const MarchSettings& march,
                            const RenderEffort& effort);

 private:
  std::size_t left_;
  std::map<std::string, Trace> traces_;  // by digests of rays and settings
};

/// Engines of which the luminance engines share a memory. They must hold one and the same stage 1, and do not train.
class RememberingEngines final : public Engines {
 public:
  /// @param inner  makes them; must outlive this
  explicit RememberingEngines(const Engines& inner) : inner_(inner) {}
  [[nodiscard]] Device device() const override { return inner_.device(); }
  [[nodiscard]] std::string description() const override { return inner_.description(); }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override;
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& grid,
                                                                std::uint64_t seed) const override {
    return inner_.make_color_bins(grid, seed);
  }
  [[nodiscard]] std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions& grid,
                                                                   std::uint64_t seed) const override {
    return inner_.make_color_field(grid, seed);
  }

 private:
  const Engines& inner_;
  std::shared_ptr<RayMemory> memory_ = std::make_shared<RayMemory>();
};

}  // namespace cnerf::compare
