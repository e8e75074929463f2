#include "encoding/cpu/hash_grid_kernels.h"

namespace cnerf {

const HashGridKernels& hash_grid_kernels() {
#if defined(__x86_64__)
  switch (active_isa()) {
    case IsaLevel::kAvx512:
      return avx512::kHashGridKernels;
    case IsaLevel::kAvx2:
      return avx2::kHashGridKernels;
    case IsaLevel::kGeneric:
      break;
  }
#endif
  return generic::kHashGridKernels;
}

}  // namespace cnerf
