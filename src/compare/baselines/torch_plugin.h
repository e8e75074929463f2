#pragma once
/// What libcnerf_compare_torch.so offers: the baselines that need LibTorch.

#include "src/compare/baselines/positional_field.h"
#include "src/compare/baselines/style_loss.h"

namespace cnerf::compare {

struct TorchBaselines {
  decltype(positional_engines)* positional;
  decltype(make_style_loss)* style;
};

/// ARF's loss, inside the plug-in.
[[nodiscard]] std::unique_ptr<StyleLoss> make_torch_style_loss(const std::filesystem::path& weights,
                                                               const LabPicture& reference);

}  // namespace cnerf::compare
