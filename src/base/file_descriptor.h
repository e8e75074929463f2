#pragma once
/// Descriptors of open files, and the operating system's locks on them. POSIX only.

#include <filesystem>

namespace cnerf {

/// An owned file descriptor, closed on exec as well: no other program inherits it and keeps a pipe open.
class FileDescriptor {
 public:
  explicit FileDescriptor(int number = -1) : number_(number) {}
  ~FileDescriptor() { reset(); }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  void reset(int number = -1);
  [[nodiscard]] int number() const { return number_; }

  /// `flock`, repeated where a signal came in between.
  /// @return  whether it succeeded; errno says why not
  [[nodiscard]] bool lock(int operation) const;
  /// Whether `path` names this very file: whoever let go of a lock may have removed the file that is locked now.
  [[nodiscard]] bool is_still_at(const std::filesystem::path& path) const;

 private:
  int number_;
};

}  // namespace cnerf
