#pragma once
/// Regular files of an uncompressed tar archive (POSIX ustar), or of a folder, as name and content.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace cnerf {

struct NamedBytes {
  std::string name;  ///< path inside the archive or folder, '/' between its parts
  std::vector<std::byte> content;
};

/// Entries in the archive's order; of a folder, sorted by name.
/// @throws MissingInputError  `path` does not exist.
/// @throws InputError         the archive is damaged or cut short.
[[nodiscard]] std::vector<NamedBytes> read_tar_or_folder(const std::filesystem::path& path);

}  // namespace cnerf
