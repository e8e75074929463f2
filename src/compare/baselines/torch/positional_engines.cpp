// The engines of the paper's own field by LibTorch: see positional_field.h.

#include "src/compare/baselines/torch/factories.h"
#include "src/compare/baselines/torch/positional_nets.h"

namespace cnerf::compare {
namespace {

class PositionalEngines final : public Engines {
 public:
  PositionalEngines(const PositionalRays& rays, const Engines& others) : rays_(rays), others_(others) {}
  [[nodiscard]] Device device() const override { return Device::kCpu; }
  [[nodiscard]] std::string description() const override { return "positional encoding, LibTorch"; }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override {
    PositionalLuminance made = make_positional_luminance(options, rays_);
    encoding_ = made.encoding;
    return std::move(made.engine);
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& /*grid*/,
                                                                std::uint64_t seed) const override {
    return make_positional_color_bins(seed, encoding_);
  }
  [[nodiscard]] std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions& grid,
                                                                   std::uint64_t seed) const override {
    return others_.make_color_field(grid, seed);
  }

 private:
  PositionalRays rays_;
  const Engines& others_;
  mutable Trunk encoding_ = nullptr;  // of the luminance engine made last
};

}  // namespace

std::unique_ptr<Engines> make_positional_engines(const PositionalRays& rays, const Engines& others) {
  return std::make_unique<PositionalEngines>(rays, others);
}

}  // namespace cnerf::compare
