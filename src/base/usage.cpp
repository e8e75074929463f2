#include "src/base/usage.h"

#include <sys/resource.h>

namespace cnerf {

std::size_t peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return std::size_t(usage.ru_maxrss) * 1024;  // Linux counts KiB
}

}  // namespace cnerf
