// The one symbol that the program asks libcnerf_torch.so for.

#include <torch/version.h>

#include "src/colorizer/kinds.h"
#include "src/colorizer/torch/encoder.h"
#include "src/colorizer/torch/torch_threads.h"

extern "C" __attribute__((visibility("default"))) const cnerf::TorchColorizers* cnerf_torch_colorizers() {
  cnerf::limit_torch_threads();
  static const cnerf::TorchColorizers colorizers{cnerf::make_builtin_colorizer, cnerf::make_reference_colorizer,
                                                 cnerf::make_torchscript_colorizer, cnerf::make_torch_picture_encoder,
                                                 TORCH_VERSION};
  return &colorizers;
}
