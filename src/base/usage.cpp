#include "src/base/usage.h"

#include <sys/resource.h>
#include <unistd.h>

#include <fstream>

namespace cnerf {

std::size_t peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return std::size_t(usage.ru_maxrss) * 1024;  // Linux counts KiB
}

std::size_t held_memory_bytes() {
  std::size_t size = 0, resident = 0;  // pages
  std::ifstream("/proc/self/statm") >> size >> resident;
  return resident * std::size_t(::sysconf(_SC_PAGESIZE));
}

}  // namespace cnerf
