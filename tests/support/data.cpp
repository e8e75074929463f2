#include "tests/support/data.h"

#include <unistd.h>

#include <atomic>
#include <cstdlib>

namespace cnerf::test {
namespace fs = std::filesystem;

std::optional<fs::path> shared_data(const std::string& relative) {
  const char* configured = std::getenv("CNERF_DATA");
  const fs::path root = configured != nullptr ? fs::path(configured) : fs::path(CNERF_SOURCE_DIR) / "../shared/data";
  const fs::path wanted = root / relative;
  if (!fs::exists(wanted)) return std::nullopt;
  return fs::canonical(wanted);
}

TempDir::TempDir() {
  static std::atomic<int> counter{0};
  path_ = fs::temp_directory_path() /
          ("cnerf-test-" + std::to_string(::getpid()) + "-" + std::to_string(counter.fetch_add(1)));
  fs::create_directories(path_);
}

TempDir::~TempDir() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace cnerf::test
