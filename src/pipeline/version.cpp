#include "src/pipeline/version.h"

namespace cnerf::pipeline {

std::string version_text() {
  return CNERF_VERSION;
}

}  // namespace cnerf::pipeline
