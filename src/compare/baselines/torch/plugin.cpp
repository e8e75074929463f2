// The one symbol that the program asks libcnerf_compare_torch.so for, and the engines of the paper's own field: see
// positional_field.h.

#include "src/compare/baselines/torch/positional_nets.h"
#include "src/compare/baselines/torch_plugin.h"
#include "src/compare/derived_engines.h"

namespace cnerf::compare {
namespace {

class PositionalEngines final : public DerivedEngines {
 public:
  PositionalEngines(const PositionalRays& rays, const Engines& others) : DerivedEngines(others), rays_(rays) {}
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

 private:
  PositionalRays rays_;
  mutable Trunk encoding_ = nullptr;  // of the luminance engine made last
};

std::unique_ptr<Engines> make_positional_engines(const PositionalRays& rays, const Engines& others) {
  return std::make_unique<PositionalEngines>(rays, others);
}

}  // namespace
}  // namespace cnerf::compare

extern "C" __attribute__((visibility("default"))) const cnerf::compare::TorchBaselines* cnerf_torch_baselines() {
  static const cnerf::compare::TorchBaselines baselines{cnerf::compare::make_positional_engines,
                                                        cnerf::compare::make_torch_style_loss,
                                                        cnerf::compare::make_torch_text_loss};
  return &baselines;
}
