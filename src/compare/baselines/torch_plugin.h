#pragma once
/// What libcnerf_compare_torch.so offers: the baselines that need LibTorch.

#include "src/compare/baselines/picture_loss.h"
#include "src/compare/baselines/positional_field.h"

namespace cnerf::compare {

struct TorchBaselines {
  decltype(positional_engines)* positional;
  decltype(make_style_loss)* style;
  decltype(make_text_loss)* text;
};

// Inside the plug-in.
[[nodiscard]] std::unique_ptr<PictureLoss> make_torch_style_loss(const std::filesystem::path& weights,
                                                                 const LabPicture& reference);
[[nodiscard]] std::unique_ptr<PictureLoss> make_torch_text_loss(const TextGuide& guide);

}  // namespace cnerf::compare
