#pragma once
/// Engines on top of others.

#include <memory>
#include <string>

#include "src/engine/engines.h"

namespace cnerf::compare {

/// Makes what `inner` makes; a method says in which of the three it differs.
class DerivedEngines : public Engines {
 public:
  /// @param inner  must outlive this
  explicit DerivedEngines(const Engines& inner) : inner_(inner) {}
  [[nodiscard]] Device device() const override { return inner_.device(); }
  [[nodiscard]] std::string description() const override { return inner_.description(); }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override {
    return inner_.make_luminance(options);
  }
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
};

/// Engines of which the distributions of colours come from elsewhere.
class MixedEngines final : public DerivedEngines {
 public:
  MixedEngines(const Engines& usual, const Engines& color_bins) : DerivedEngines(usual), color_bins_(color_bins) {}
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& grid,
                                                                std::uint64_t seed) const override {
    return color_bins_.make_color_bins(grid, seed);
  }

 private:
  const Engines& color_bins_;
};

/// Engines that remain visible to who handed them on.
class WatchedEngines final : public DerivedEngines {
 public:
  using DerivedEngines::DerivedEngines;
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override {
    auto engine = DerivedEngines::make_luminance(options);
    luminance_ = engine.get();
    return engine;
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& grid,
                                                                std::uint64_t seed) const override {
    auto engine = DerivedEngines::make_color_bins(grid, seed);
    color_bins_ = engine.get();
    return engine;
  }

  /// Those made last; not owned.
  [[nodiscard]] const LuminanceEngine& luminance() const { return *luminance_; }
  [[nodiscard]] const ColorBinEngine& color_bins() const { return *color_bins_; }

 private:
  mutable const LuminanceEngine* luminance_ = nullptr;
  mutable const ColorBinEngine* color_bins_ = nullptr;
};

}  // namespace cnerf::compare
