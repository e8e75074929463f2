#include "src/base/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/file_descriptor.h"
#include "src/base/files.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kLongestHolder = 200;  // bytes

/// "pid 1234, `cnerf bake ...`": no more of the command line, which may hold a token.
std::string this_process() {
  std::ifstream words("/proc/self/cmdline", std::ios::binary);
  std::string program, command;
  std::getline(words, program, '\0');
  std::getline(words, command, '\0');
  char host[256] = "";
  ::gethostname(host, sizeof host - 1);
  return "pid " + std::to_string(::getpid()) + " on " + host + ", `" + fs::path(program).filename().string() + " " +
         command + " ...`";
}

/// What a lock file says of its holder, as one line that is safe to print: the file may be anybody's.
std::string holder_of(int file) {
  char text[kLongestHolder];
  const ::ssize_t got = ::pread(file, text, sizeof text, 0);
  std::string holder(text, std::size_t(std::max<::ssize_t>(got, 0)));
  std::ranges::replace_if(
      holder, [](char c) { return c < ' ' || c > '~'; }, '?');
  return holder.empty() ? "" : " (" + holder + ")";
}

}  // namespace

struct FolderLock::Held {
  fs::path path;  ///< of the lock file
  Mode mode = Mode::kAlone;
  FileDescriptor file;
  bool is_new;  ///< the folder
  bool is_locked = true;

  Held(fs::path where, Mode how, bool is_new_folder) : path(std::move(where)), mode(how), is_new(is_new_folder) {
    do {
      file.reset(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0644));
      if (file.number() < 0) {
        throw OutputError(path.parent_path().string() + ": cannot be written to: " + std::strerror(errno));
      }
      take();
      // Whoever let go in between may have removed the file that is locked now.
    } while (is_locked && !file.is_still_at(path));
    if (!is_locked) return;
    const std::string holder = this_process().substr(0, kLongestHolder);
    // Only for messages: a full disk must not keep anybody from working. An empty lock belongs to somebody who is
    // about to take it: one that a power cut emptied would stay for ever.
    if (::ftruncate(file.number(), 0) == 0) (void)!::pwrite(file.number(), holder.data(), holder.size(), 0);
    (void)!::fdatasync(file.number());
  }
  /// The last one removes the file, while nobody else can have locked it.
  ~Held() {
    if (!is_locked || !file.lock(LOCK_EX | LOCK_NB)) return;
    ::unlink(path.c_str());
    if (is_new) ::rmdir(path.parent_path().c_str());  // if it is empty
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;

 private:
  void take() {
    if (file.lock((mode == Mode::kAlone ? LOCK_EX : LOCK_SH) | LOCK_NB)) return;
    if (errno == EWOULDBLOCK) {
      throw BusyError("another cnerf" + holder_of(file.number()) + " works in " + path.parent_path().string());
    }
    is_locked = false;  // ENOLCK, EOPNOTSUPP, ...: there are none here
  }
};

FolderLock::FolderLock(const fs::path& folder, Mode mode) {
  const bool is_new = make_folders(folder);
  std::error_code failure;
  const fs::path path = fs::canonical(folder, failure) / kFile;
  if (failure) throw OutputError(folder.string() + ": cannot be written to: " + failure.message());

  static std::mutex mutex;
  static std::map<fs::path, std::weak_ptr<Held>> held_here;
  const std::lock_guard guard(mutex);
  std::weak_ptr<Held>& known = held_here[path];
  held_ = known.lock();
  if (held_) {
    CNERF_CHECK(held_->mode == Mode::kAlone || mode == Mode::kShared, "a shared lock cannot become one alone");
    return;
  }
  held_ = std::make_shared<Held>(path, mode, is_new);
  known = held_;
}

bool FolderLock::is_held() const {
  return held_ == nullptr || held_->is_locked;
}

void clear_folder(const fs::path& folder) {
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    if (entry.path().filename() != FolderLock::kFile) remove_output(entry.path());
  }
}

bool is_vacant(const fs::path& folder, std::initializer_list<fs::path> besides) {
  std::error_code failure;
  if (!fs::exists(folder, failure)) return true;
  const fs::directory_iterator entries(folder, failure);
  return !failure && std::all_of(begin(entries), end(entries), [&](const auto& entry) {
    const fs::path name = entry.path().filename();
    return name == FolderLock::kFile || std::ranges::find(besides, name) != besides.end() || is_temporary(name);
  });
}

RecordTurn::RecordTurn(const fs::path& folder) : folder_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  (void)folder_.lock(LOCK_EX);  // where there are no locks, there is no turn to wait for
}

}  // namespace cnerf
