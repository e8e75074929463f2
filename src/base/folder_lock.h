#pragma once
/// One writer in a folder at a time: two programs that write the same files make a mixture of both.

#include <filesystem>
#include <initializer_list>
#include <memory>

#include "src/base/file_descriptor.h"

namespace cnerf {

/// Holds a folder while it lives, by a lock of the operating system on `.cnerf.lock` in it: who dies lets go, and
/// whoever only reads is not asked. A process that holds a folder may hold it again, as what it has or less.
class FolderLock {
 public:
  enum class Mode {
    kAlone,   ///< for who writes the folder's own files, or clears it
    kShared,  ///< for who works in a folder below, which it holds alone
  };

  /// Makes the folder if needed; one that is left empty goes again.
  /// @throws BusyError    at once when another process holds it, naming that process.
  /// @throws OutputError  when nothing can be written there.
  explicit FolderLock(const std::filesystem::path& folder, Mode mode = Mode::kAlone);

  /// For a process whose launch has another one that holds the folder for all.
  [[nodiscard]] static FolderLock of_another_process() { return {}; }

  /// False on a file system that knows no locks (some network shares): the user has to take care.
  [[nodiscard]] bool is_held() const;

  /// The lock file's name, for who asks whether a folder is empty.
  static constexpr const char* kFile = ".cnerf.lock";

 private:
  FolderLock() = default;
  struct Held;
  std::shared_ptr<Held> held_;  ///< null = by another process
};

/// Removes what a folder holds, but not the lock of who clears it.  @throws OutputError.
void clear_folder(const std::filesystem::path& folder);

/// Whether a folder is missing or holds nothing but, perhaps, a lock, what killed writers left, and files or folders of
/// the names `besides`, with which work begins there that was killed at once.
[[nodiscard]] bool is_vacant(const std::filesystem::path& folder,
                             std::initializer_list<std::filesystem::path> besides = {});

/// Waits until no other process changes a record of the folder: for reading, changing and writing it as one.
class RecordTurn {
 public:
  explicit RecordTurn(const std::filesystem::path& folder);

 private:
  FileDescriptor folder_;
};

}  // namespace cnerf
