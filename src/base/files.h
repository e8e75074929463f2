#pragma once
/// Files that are either whole or not there.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cnerf {

/// Lets `write` fill a temporary file beside `target`, then renames it over `target`.
/// When `write` throws, the temporary file is removed and `target` stays as it was. The temporary name keeps the
/// extension of `target`, since libraries choose a format by it. Missing parent folders are made.
/// @throws OutputError  when the folder cannot be made or the file cannot be renamed.
void write_atomically(const std::filesystem::path& target,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

/// Writes `content` by `write_atomically`.  @throws OutputError  naming the file, e.g. on a full disk.
void write_file(const std::filesystem::path& target, std::span<const std::byte> content);
void write_file(const std::filesystem::path& target, std::string_view content);

/// The whole file.  @throws MissingInputError, InputError.
[[nodiscard]] std::vector<std::byte> read_binary_file(const std::filesystem::path& file);
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file);

/// Hex SHA-256 of `content`, for manifests and weights.
[[nodiscard]] std::string sha256(std::span<const std::byte> content);
/// The same of a file, of which little is held in memory at a time.  @throws MissingInputError, InputError.
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace cnerf
