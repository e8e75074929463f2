#pragma once
/// The name of a folder, however it was given.

#include <filesystem>

namespace cnerf {

/// A path whose last part is the folder's name: absolute and without a slash at its end, which would be an empty one.
[[nodiscard]] inline std::filesystem::path absolute_folder(const std::filesystem::path& given) {
  const std::filesystem::path folder = std::filesystem::absolute(given).lexically_normal();
  return folder.filename().empty() ? folder.parent_path() : folder;
}

}  // namespace cnerf
