#include "tests/support/data.h"

#include <cstdlib>
#include <stdexcept>
#include <string>

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
  // A name that nobody has: a test that was killed leaves its folder behind.
  std::string name = (fs::temp_directory_path() / "cnerf-test-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder: " + name);
  path_ = name;
}

TempDir::~TempDir() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace cnerf::test
