#include "src/app/version.h"

namespace cnerf {

std::string version_text() {
  return CNERF_VERSION;
}

bool has_cuda_engine() {
  return CNERF_CUDA_ENGINE != 0;
}

}  // namespace cnerf
