#pragma once
/// Engines for bakes, which ask them for their device alone.

#include "src/engine/engines.h"

namespace cnerf::bake::test {

class ProcessorAlone final : public Engines {
 public:
  [[nodiscard]] Device device() const override { return Device::kCpu; }
  [[nodiscard]] std::string description() const override { return "none"; }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions&) const override {
    return nullptr;
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions&, std::uint64_t) const override {
    return nullptr;
  }
  [[nodiscard]] std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions&,
                                                                   std::uint64_t) const override {
    return nullptr;
  }
};

}  // namespace cnerf::bake::test
