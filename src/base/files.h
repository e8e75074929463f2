#pragma once
/// Files that are either whole or not there.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/base/file_descriptor.h"

namespace cnerf {

/// A file that comes into being whole. What is written goes to a temporary file beside the target and takes its place
/// at `commit`, when it is on the disk: neither a kill nor a power cut leaves half a file, or none where one was.
class NewFile {
 public:
  /// Missing parent folders are made.  @throws OutputError  when the temporary file cannot be made.
  explicit NewFile(std::filesystem::path target);
  /// Without `commit`, the temporary file goes and the target stays as it was.
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  /// To be opened and written by whoever makes the content. It has the extension of the target, since libraries choose
  /// a format by it.
  [[nodiscard]] const std::filesystem::path& temporary() const { return temporary_; }
  /// @throws OutputError  naming the target, e.g. on a full disk; the target stays as it was.
  void commit();

 private:
  std::filesystem::path target_, temporary_;
  FileDescriptor file_;  ///< of the temporary file, locked while its writer lives
  bool is_committed_ = false;
};

/// Lets `write` fill a NewFile, and commits it.  @throws OutputError, and what `write` throws.
void write_atomically(const std::filesystem::path& target,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

/// Whether a name is one of NewFile's temporary files.
[[nodiscard]] bool is_temporary(const std::filesystem::path& file);

/// Removes what writers that were killed left in a folder and, at most `depth` levels, below it: temporary files of
/// NewFile that nobody writes to any more, and locks that nobody holds.
void remove_leftovers(const std::filesystem::path& folder, int depth = 0);

/// The regular files of a folder that are wanted, by name.  @throws std::filesystem::filesystem_error
[[nodiscard]] std::vector<std::filesystem::path> files_in(
    const std::filesystem::path& folder, const std::function<bool(const std::filesystem::path&)>& is_wanted);

/// Makes a folder and those above it; their names are on the disk when it returns.
/// @return  whether it is new  @throws OutputError
bool make_folders(const std::filesystem::path& folder);

/// Removes a file, or a folder with all that it holds, if it is there.  @throws OutputError
void remove_output(const std::filesystem::path& path);

/// Writes `content` by `write_atomically`.  @throws OutputError  naming the file, e.g. on a full disk.
void write_file(const std::filesystem::path& target, std::span<const std::byte> content);
void write_file(const std::filesystem::path& target, std::string_view content);

/// The whole file.  @throws MissingInputError, InputError.
[[nodiscard]] std::vector<std::byte> read_binary_file(const std::filesystem::path& file);
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file);

/// Bytes as the text that they are.
[[nodiscard]] inline std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Hex SHA-256 of `content`, for manifests and weights.
[[nodiscard]] std::string sha256(std::span<const std::byte> content);
/// The same of a file, of which little is held in memory at a time.  @throws MissingInputError, InputError.
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace cnerf
