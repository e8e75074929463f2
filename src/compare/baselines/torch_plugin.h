#pragma once
/// What libcnerf_compare_torch.so offers: the baselines that need LibTorch.

#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "src/compare/baselines/positional_field.h"
#include "src/compare/baselines/style_loss.h"

namespace cnerf::compare {

/// A StyleLoss by LibTorch.
struct StyleNetwork {
  virtual ~StyleNetwork() = default;
  [[nodiscard]] virtual const std::string& name() const = 0;
  [[nodiscard]] virtual double loss(const LabPicture& picture, std::span<float> gradient) const = 0;
};

struct TorchBaselines {
  std::unique_ptr<Engines> (*positional_engines)(const PositionalRays& rays, const Engines& others);
  std::unique_ptr<StyleNetwork> (*style_network)(const std::filesystem::path& network, const LabPicture& reference);
};
/// Loads the plug-in.  @throws DeviceError  it is missing or cannot be loaded.
[[nodiscard]] const TorchBaselines& torch_baselines();

}  // namespace cnerf::compare
