#include "viewer/server/page_folder.h"

#include <cstdlib>

namespace cnerf::web {
namespace fs = std::filesystem;

std::vector<fs::path> page_folders() {
  std::vector<fs::path> folders;
  if (const char* given = std::getenv("CNERF_PAGE")) folders.emplace_back(given);
  std::error_code failure;
  const fs::path executable = fs::read_symlink("/proc/self/exe", failure);
  if (!failure) folders.push_back(executable.parent_path().parent_path() / "share" / "cnerf" / "viewer");
  folders.emplace_back(CNERF_PAGE_FOLDER);
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
