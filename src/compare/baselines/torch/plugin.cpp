// The one symbol that the program asks libcnerf_compare_torch.so for.

#include "src/compare/baselines/torch/factories.h"

extern "C" __attribute__((visibility("default"))) const cnerf::compare::TorchBaselines* cnerf_torch_baselines() {
  static const cnerf::compare::TorchBaselines baselines{cnerf::compare::make_positional_engines,
                                                        cnerf::compare::make_style_network};
  return &baselines;
}
