#pragma once
/// Where the built page lies.

#include <filesystem>
#include <vector>

namespace cnerf::web {

/// The folders that are looked through: $CNERF_PAGE, then the program's data (src/base/plugin.h).
[[nodiscard]] std::vector<std::filesystem::path> page_folders();
/// The first of them that holds an index.html; empty when the program was built without the page.
[[nodiscard]] std::filesystem::path find_page();

}  // namespace cnerf::web
