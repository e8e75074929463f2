#pragma once
/// Where the built page lies.

#include <filesystem>
#include <vector>

namespace cnerf::web {

/// The folders that are looked through: $CNERF_PAGE, `../share/cnerf/viewer` beside the executable, the build tree.
[[nodiscard]] std::vector<std::filesystem::path> page_folders();
/// The first of them that holds an index.html; empty when the program was built without the page.
[[nodiscard]] std::filesystem::path find_page();

}  // namespace cnerf::web
