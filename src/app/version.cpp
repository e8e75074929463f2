#include "src/app/version.h"

namespace cnerf {

std::string version_text() {
  return CNERF_VERSION;
}

}  // namespace cnerf
