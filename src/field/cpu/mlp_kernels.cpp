#include "src/field/cpu/mlp_kernels.h"

#include "src/base/cpu_features.h"

namespace cnerf {

const MlpKernels& mlp_kernels() {
#if defined(__x86_64__)
  switch (active_isa()) {
    case IsaLevel::kAvx512:
      return avx512::kMlpKernels;
    case IsaLevel::kAvx2:
      return avx2::kMlpKernels;
    case IsaLevel::kGeneric:
      break;
  }
#endif
  return generic::kMlpKernels;
}

}  // namespace cnerf
