#include "viewer/server/page_folder.h"

#include <cstdlib>

#include "src/base/plugin.h"

namespace cnerf::web {
namespace fs = std::filesystem;

std::vector<fs::path> page_folders() {
  std::vector<fs::path> folders = data_places("viewer");
  if (const char* given = std::getenv("CNERF_PAGE")) folders.insert(folders.begin(), given);
  return folders;
}

fs::path find_page() {
  std::error_code failure;
  for (const fs::path& folder : page_folders()) {
    if (fs::is_regular_file(folder / "index.html", failure)) return folder;
  }
  return {};
}

}  // namespace cnerf::web
