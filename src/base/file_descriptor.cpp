#include "src/base/file_descriptor.h"

#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace cnerf {

void FileDescriptor::reset(int number) {
  if (number_ >= 0) ::close(number_);
  number_ = number;
}

bool FileDescriptor::lock(int operation) const {
  int result = 0;
  do {
    result = ::flock(number_, operation);
  } while (result == -1 && errno == EINTR);
  return result == 0;
}

bool FileDescriptor::is_still_at(const std::filesystem::path& path) const {
  struct stat ours {
  }, there{};
  return ::fstat(number_, &ours) == 0 && ::lstat(path.c_str(), &there) == 0 && ours.st_ino == there.st_ino &&
         ours.st_dev == there.st_dev;
}

}  // namespace cnerf
