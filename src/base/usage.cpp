#include "src/base/usage.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "src/base/byte_count.h"
#include "src/base/error.h"

namespace cnerf {
namespace {

/// Of the process, bytes; 0 where the system does not report it.
struct Memory {
  std::size_t held = 0;      ///< resident
  std::size_t reserved = 0;  ///< for data, used or not
};

Memory memory_now() {
  std::size_t size = 0, resident = 0, shared = 0, text = 0, library = 0, data = 0;  // pages
  std::ifstream("/proc/self/statm") >> size >> resident >> shared >> text >> library >> data;
  const auto page = std::size_t(::sysconf(_SC_PAGESIZE));
  return {resident * page, data * page};
}

}  // namespace

std::size_t peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return std::size_t(usage.ru_maxrss) * 1024;  // Linux counts KiB
}

std::size_t held_memory_bytes() {
  return memory_now().held;
}

void limit_memory(const std::string& amount) {
  const std::size_t bytes = bytes_from("max_memory", amount);
  const Memory now = memory_now();
  if (bytes <= now.held) {
    throw UsageError("max_memory: " + amount + " is too little, the program itself takes " + in_words(now.held));
  }
  const std::size_t unused = now.reserved - std::min(now.reserved, now.held);
  const rlimit limit{bytes + unused, RLIM_INFINITY};
  (void)::setrlimit(RLIMIT_DATA, &limit);
}

bool limit_growth(std::size_t bytes) {
  const rlim_t wanted = memory_now().reserved + bytes;
  rlimit limit{};
  (void)::getrlimit(RLIMIT_DATA, &limit);
  if (limit.rlim_cur <= wanted) return false;
  limit.rlim_cur = wanted;
  return ::setrlimit(RLIMIT_DATA, &limit) == 0;
}

}  // namespace cnerf
