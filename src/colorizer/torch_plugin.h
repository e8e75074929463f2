#pragma once
/// What libcnerf_torch.so offers: the colorizers that need LibTorch.

#include "src/colorizer/kinds.h"

namespace cnerf {

struct TorchColorizers {
  MakeColorizer* builtin;
  MakeColorizer* reference;
  MakeColorizer* torchscript;
  const char* version;  ///< of LibTorch
};
inline constexpr const char* kTorchPlugin = "torch";
inline constexpr const char* kTorchColorizersEntry = "cnerf_torch_colorizers";

}  // namespace cnerf
