/// A file layer that fails on purpose: preloaded into the program (LD_PRELOAD), it counts the operations that change
/// files below one folder and lets one of them go wrong. It knows nothing of the product.
///
///   CNERF_FAULT_ROOT      the folder that counts; without it nothing happens
///   CNERF_FAULT_KIND      count (nothing fails), eio, enospc, edquot, short, kill, power, power-names, slow, memory
///   CNERF_FAULT_AT        number of the operation, from 1; "end" cuts the power when the program has ended
///   CNERF_FAULT_COUNT     file for the number of operations, written at the end of the program
///   CNERF_FAULT_LOG       file for a line per operation: number, what, bytes, path
///   CNERF_FAULT_SHADOW    folder on the same file system, outside of the root: what is replaced is kept there (power)
///   CNERF_FAULT_MS        milliseconds that a write takes, half of it between its two halves (slow)
///   CNERF_FAULT_BYTES     what is a large allocation (memory)  [65536]
///   CNERF_FAULT_PROGRAM   name of the executable that is meant  [cnerf]; other programs that inherit this work as ever
///   CNERF_FAULT_CHILDREN  1: every program that inherits this counts, each on its own
///
/// eio: the operation fails once. enospc, edquot: it and all later ones that need room fail. short: a write takes half
/// of its bytes, then as enospc. kill: the process dies, in the middle if the operation is a write. power: what no
/// fsync made lasting is taken back, then the process dies: files are cut to the length they had at their last fsync,
/// and names made, replaced or removed in a folder since its last fsync are as before. A new folder lasts once anything
/// below it was synced, as with the journals of file systems. power-names: names last at once and only what is in files
/// is lost, as where names are journalled and data is not: who renames before an fsync is left with an empty file.
/// memory: allocations are counted instead, from main on.

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio_ext.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

// The C library names them.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
}
// NOLINTEND(bugprone-reserved-identifier)

namespace {

enum class Kind { kOff, kCount, kEio, kEnospc, kEdquot, kShort, kKill, kPower, kPowerNames, kSlow, kMemory };

struct Settings {
  Kind kind = Kind::kOff;
  char root[PATH_MAX] = "";
  std::size_t root_length = 0;
  char shadow[PATH_MAX] = "";
  char count[PATH_MAX] = "";
  long at = 0;
  bool at_end = false;
  long milliseconds = 0;
  std::size_t large = 65536;
  int log = -1;
  pid_t process = 0;
};
Settings settings;
std::atomic<bool> is_active{false};
std::atomic<bool> is_in_main{false};
std::atomic<long> operations{0};
std::atomic<bool> is_full{false};
std::atomic<int> shadows{0};

/// The function that this one stands before.
template <typename Function>
Function* next_of(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}
#define REAL(name)                                                  \
  ([] {                                                             \
    static auto* const function = next_of<decltype(::name)>(#name); \
    return function;                                                \
  }())

/// What the operation is to `decide`.
enum class What { kCreate, kWrite, kResize, kRename, kRemove, kMakeFolder, kLink, kSync };
const char* name_of(What what) {
  switch (what) {
    case What::kCreate:
      return "create";
    case What::kWrite:
      return "write";
    case What::kResize:
      return "resize";
    case What::kRename:
      return "rename";
    case What::kRemove:
      return "remove";
    case What::kMakeFolder:
      return "mkdir";
    case What::kLink:
      return "link";
    case What::kSync:
      return "sync";
  }
  return "?";
}
bool needs_room(What what) {
  return what == What::kCreate || what == What::kWrite || what == What::kMakeFolder || what == What::kLink;
}

struct Decision {
  int error = 0;      ///< it fails with this
  bool half = false;  ///< a write takes half of its bytes
  bool dies = false;  ///< after that
  bool slow = false;
};

[[noreturn]] void die() {
  ::kill(::getpid(), SIGKILL);
  for (;;) ::pause();
}

bool counts_here() {
  return is_active.load(std::memory_order_relaxed) && ::getpid() == settings.process;
}

bool is_below_root(const char* path) {
  const char after = std::strncmp(path, settings.root, settings.root_length) == 0 ? path[settings.root_length] : '?';
  return after == '/' || after == '\0';
}

/// The path of `name` as seen from `folder`, if it lies below the root.
std::optional<std::string> counted_path(int folder, const char* name) {
  if (!counts_here() || name == nullptr || settings.kind == Kind::kMemory) return std::nullopt;
  std::string path;
  if (name[0] == '/') {
    path = name;
  } else {
    char base[PATH_MAX];
    if (folder == AT_FDCWD) {
      if (::getcwd(base, sizeof base) == nullptr) return std::nullopt;
    } else {
      const ssize_t length = ::readlink(("/proc/self/fd/" + std::to_string(folder)).c_str(), base, sizeof base - 1);
      if (length < 0) return std::nullopt;
      base[length] = '\0';
    }
    path = std::string(base) + "/" + name;
  }
  if (!is_below_root(path.c_str())) return std::nullopt;
  return path;
}

std::optional<std::string> path_of(int file) {
  if (!counts_here() || settings.kind == Kind::kMemory) return std::nullopt;
  char link[64], path[PATH_MAX];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const ssize_t length = ::readlink(link, path, sizeof path - 1);
  if (length < 0) return std::nullopt;
  path[length] = '\0';
  if (!is_below_root(path)) return std::nullopt;
  return std::string(path);
}

// ---------------------------------------------------------------------------------------------------- power cuts

std::string parent_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? std::string() : path.substr(0, slash);
}

/// What a cut of the power takes back.
class Unsynced {
 public:
  std::recursive_mutex mutex;

  void file_changes(int file, bool is_new) {
    struct stat state {};
    if (::fstat(file, &state) != 0 || !S_ISREG(state.st_mode)) return;
    Data& data = data_[{state.st_dev, state.st_ino}];
    if (data.file < 0) {
      data.file = REAL(open)(("/proc/self/fd/" + std::to_string(file)).c_str(), O_RDWR | O_CLOEXEC);
      data.synced = is_new ? 0 : state.st_size;
    }
    if (is_new) data.synced = 0;
  }
  void synced(int file, const std::string& path) {
    struct stat state {};
    if (::fstat(file, &state) != 0) return;
    const bool is_folder = S_ISDIR(state.st_mode);
    if (!is_folder) {
      const auto found = data_.find({state.st_dev, state.st_ino});
      if (found != data_.end()) {
        if (found->second.file >= 0) ::close(found->second.file);
        data_.erase(found);
      }
    }
    std::erase_if(changes_, [&](const Change& change) {
      if (change.what == Change::kFolder)
        return (path + "/").compare(0, change.path.size() + 1, change.path + "/") == 0;
      return is_folder && parent_of(change.path) == path;
    });
  }
  void created(const std::string& path) { changes_.push_back({Change::kNew, path, "", ""}); }
  void folder_made(const std::string& path) { changes_.push_back({Change::kFolder, path, "", ""}); }
  /// To be called before a file goes or is replaced.  @return  where it is kept, or nothing
  std::string keep(const std::string& path) {
    const std::string shadow = std::string(settings.shadow) + "/" + std::to_string(++shadows);
    return REAL(link)(path.c_str(), shadow.c_str()) == 0 ? shadow : std::string();
  }
  void removed(const std::string& path, const std::string& kept) {
    if (!kept.empty()) changes_.push_back({Change::kGone, path, "", kept});
  }
  void renamed(const std::string& from, const std::string& to, const std::string& kept) {
    changes_.push_back({Change::kMoved, to, from, kept});
  }

  void take_back() {
    for (const auto& [inode, data] : data_) {
      struct stat state {};
      if (data.file >= 0 && ::fstat(data.file, &state) == 0 && state.st_size > data.synced) {
        (void)!REAL(ftruncate)(data.file, data.synced);
      }
    }
    if (settings.kind == Kind::kPowerNames) return;
    for (auto change = changes_.rbegin(); change != changes_.rend(); ++change) {
      const char* path = change->path.c_str();
      switch (change->what) {
        case Change::kNew:
          REAL(unlink)(path);
          break;
        case Change::kFolder:
          REAL(rmdir)(path);
          break;
        case Change::kGone:
          REAL(link)(change->kept.c_str(), path);
          break;
        case Change::kMoved:
          REAL(rename)(path, change->from.c_str());
          if (!change->kept.empty()) REAL(link)(change->kept.c_str(), path);
          break;
      }
    }
  }

 private:
  struct Data {
    int file = -1;
    off_t synced = 0;
  };
  struct Change {
    enum What { kNew, kFolder, kGone, kMoved } what;
    std::string path, from, kept;
  };
  std::map<std::pair<dev_t, ino_t>, Data> data_;
  std::vector<Change> changes_;
};
Unsynced& unsynced() {
  static auto* const all = new Unsynced;  // outlives the destructors of others
  return *all;
}

bool keeps_record() {
  return settings.kind == Kind::kPower || settings.kind == Kind::kPowerNames;
}

/// One operation at a time while a power cut is planned: what it takes back has an order.
class Turn {
 public:
  Turn() : is_taken_(keeps_record()) {
    if (is_taken_) unsynced().mutex.lock();
  }
  ~Turn() {
    const int error = errno;
    if (is_taken_) unsynced().mutex.unlock();
    errno = error;
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  bool is_taken_;
};
// ---------------------------------------------------------------------------------------------------- decisions

void log_line(long number, const char* what, std::size_t bytes, const std::string& path) {
  if (settings.log < 0) return;
  const std::string line = std::to_string(number) + " " + what + " " + std::to_string(bytes) + " " + path + "\n";
  (void)!REAL(write)(settings.log, line.data(), line.size());
}

Decision decide(What what, std::size_t bytes, const std::string& path) {
  const long number = ++operations;
  log_line(number, name_of(what), bytes, path);
  const bool is_it = number == settings.at;
  Decision decision;
  switch (settings.kind) {
    case Kind::kOff:
    case Kind::kCount:
    case Kind::kMemory:
      break;
    case Kind::kEio:
      if (is_it) decision.error = EIO;
      break;
    case Kind::kEnospc:
    case Kind::kEdquot:
      if (is_it) is_full = true;
      if (is_full && needs_room(what)) decision.error = settings.kind == Kind::kEnospc ? ENOSPC : EDQUOT;
      break;
    case Kind::kShort:
      if (is_full && needs_room(what)) decision.error = ENOSPC;
      if (is_it) {
        is_full = true;
        if (what == What::kWrite && bytes > 1) {
          decision.half = true;
        } else if (needs_room(what)) {
          decision.error = ENOSPC;
        }
      }
      break;
    case Kind::kKill:
      if (!is_it) break;
      if (what != What::kWrite) die();
      decision.half = decision.dies = true;
      break;
    case Kind::kPower:
    case Kind::kPowerNames:
      if (!is_it) break;
      unsynced().take_back();
      die();
    case Kind::kSlow:
      decision.slow = what == What::kWrite;
      break;
  }
  return decision;
}

void wait_half() {
  const long half = settings.milliseconds * 500'000L;
  const timespec time{half / 1'000'000'000L, half % 1'000'000'000L};
  ::nanosleep(&time, nullptr);
}

/// A write of `bytes` bytes by `real(first, count)`, which writes `count` of them from `first` on.
template <typename Real>
ssize_t counted_write(int file, std::size_t bytes, const Real& real) {
  const auto path = path_of(file);
  if (!path) return real(0, bytes);
  const Turn turn;
  const Decision decision = decide(What::kWrite, bytes, *path);
  if (decision.error != 0) {
    errno = decision.error;
    return -1;
  }
  if (keeps_record()) unsynced().file_changes(file, false);
  if (decision.half) {
    const ssize_t written = bytes / 2 > 0 ? real(0, bytes / 2) : 0;
    if (decision.dies) die();
    return written;
  }
  if (decision.slow && bytes > 1) {
    wait_half();
    const ssize_t first = real(0, bytes / 2);
    if (first < ssize_t(bytes / 2)) return first;
    wait_half();
    const ssize_t rest = real(bytes / 2, bytes - bytes / 2);
    return rest < 0 ? first : first + rest;
  }
  return real(0, bytes);
}

/// An operation on a name: 0 or -1.
template <typename Real>
int counted(What what, const std::string& path, const Real& real) {
  const Decision decision = decide(what, 0, path);
  if (decision.error != 0) {
    errno = decision.error;
    return -1;
  }
  return real();
}

bool changes_files(int flags) {
  return (flags & O_ACCMODE) != O_RDONLY || (flags & (O_CREAT | O_TRUNC)) != 0;
}

template <typename Real>
int counted_open(int folder, const char* name, int flags, const Real& real) {
  const bool is_nameless = (flags & O_TMPFILE) == O_TMPFILE;  // a new file in the folder `name`, of no name
  if (!changes_files(flags) || (!is_nameless && (flags & O_DIRECTORY) != 0)) return real();
  const auto path = counted_path(folder, name);
  if (!path) return real();
  const Turn turn;
  struct stat before {};
  const bool was_there = !is_nameless && ::lstat(path->c_str(), &before) == 0;
  const Decision decision = decide(What::kCreate, 0, *path);
  if (decision.error != 0 &&
      !(was_there && decision.error != EIO)) {  // a file that is there can be opened on a full disk
    errno = decision.error;
    return -1;
  }
  const int file = real();
  if (file >= 0 && keeps_record()) {
    if (!was_there && !is_nameless) unsynced().created(*path);
    if (!was_there || (flags & O_TRUNC) != 0) unsynced().file_changes(file, true);
  }
  return file;
}

// ---------------------------------------------------------------------------------------------------- streams

/// Streams of the C library write by calls that nobody can stand before. What is written to those below the root goes
/// to the file at once.
constexpr std::size_t kStreams = 512;
std::array<std::atomic<FILE*>, kStreams> streams{};

bool is_known(FILE* stream) {
  if (!counts_here()) return false;
  for (const auto& known : streams) {
    if (known.load(std::memory_order_relaxed) == stream) return true;
  }
  return false;
}
void remember(FILE* stream) {
  for (auto& known : streams) {
    FILE* none = nullptr;
    if (known.compare_exchange_strong(none, stream)) return;
  }
}
void forget(FILE* stream) {
  for (auto& known : streams) {
    FILE* expected = stream;
    known.compare_exchange_strong(expected, nullptr);
  }
}

int flags_of(const char* mode) {
  const bool both = std::strchr(mode, '+') != nullptr;
  switch (mode[0]) {
    case 'r':
      return both ? O_RDWR : O_RDONLY;
    case 'w':
      return (both ? O_RDWR : O_WRONLY) | O_CREAT | O_TRUNC;
    default:
      return (both ? O_RDWR : O_WRONLY) | O_CREAT | O_APPEND;
  }
}

template <typename Real>
FILE* counted_fopen(const char* name, const char* mode, const Real& real) {
  FILE* stream = nullptr;
  counted_open(AT_FDCWD, name, flags_of(mode), [&] {
    stream = real();
    return stream == nullptr ? -1 : ::fileno(stream);
  });
  if (stream != nullptr && changes_files(flags_of(mode)) && counted_path(AT_FDCWD, name)) remember(stream);
  return stream;
}

constexpr int kErrorSeen = 0x20;  // glibc's _IO_ERR_SEEN

/// What lies in the stream's buffer, as one write.
int flush_counted(FILE* stream) {
  const std::size_t waiting = __fpending(stream);
  if (waiting > 0) {
    const ssize_t done = counted_write(::fileno(stream), waiting, [&](std::size_t, std::size_t count) -> ssize_t {
      if (count == waiting) return REAL(fflush)(stream) == 0 ? ssize_t(waiting) : -1;
      return 0;  // half of it: none, as the rest cannot be told apart
    });
    if (done != ssize_t(waiting)) {
      __fpurge(stream);
      stream->_flags |= kErrorSeen;
      if (done >= 0) errno = ENOSPC;
      return EOF;
    }
  }
  return REAL(fflush)(stream);
}

std::size_t fwrite_counted(const void* data, std::size_t size, std::size_t count, FILE* stream) {
  if (size == 0 || count == 0) return 0;
  if (flush_counted(stream) != 0) return 0;
  const off_t place = ::ftello(stream);
  const int file = ::fileno(stream);
  if (place < 0 || ::lseek(file, place, SEEK_SET) < 0) return REAL(fwrite)(data, size, count, stream);
  const auto* bytes = static_cast<const char*>(data);
  std::size_t done = 0;
  while (done < size * count) {
    const ssize_t written = ::write(file, bytes + done, size * count - done);
    if (written <= 0) {
      stream->_flags |= kErrorSeen;
      break;
    }
    done += std::size_t(written);
  }
  const int error = errno;
  ::fseeko(stream, place + off_t(done), SEEK_SET);
  errno = error;
  return done / size;
}

// ---------------------------------------------------------------------------------------------------- start and end

const char* variable(const char* name) {
  const char* value = ::getenv(name);
  return value == nullptr ? "" : value;
}

Kind kind_of(const char* word) {
  const std::pair<const char*, Kind> kinds[] = {
      {"count", Kind::kCount}, {"eio", Kind::kEio},      {"enospc", Kind::kEnospc}, {"edquot", Kind::kEdquot},
      {"short", Kind::kShort}, {"kill", Kind::kKill},    {"power", Kind::kPower},   {"power-names", Kind::kPowerNames},
      {"slow", Kind::kSlow},   {"memory", Kind::kMemory}};
  for (const auto& [name, kind] : kinds) {
    if (std::strcmp(word, name) == 0) return kind;
  }
  return Kind::kOff;
}

bool is_the_program() {
  if (std::strcmp(variable("CNERF_FAULT_CHILDREN"), "1") == 0) return true;
  char path[PATH_MAX];
  const ssize_t length = ::readlink("/proc/self/exe", path, sizeof path - 1);
  if (length < 0) return false;
  path[length] = '\0';
  const char* program = variable("CNERF_FAULT_PROGRAM");
  const char* slash = std::strrchr(path, '/');
  return std::strcmp(slash == nullptr ? path : slash + 1, *program == '\0' ? "cnerf" : program) == 0;
}

__attribute__((constructor)) void begin() {
  const char* root = variable("CNERF_FAULT_ROOT");
  if (*root == '\0' || !is_the_program()) return;
  std::snprintf(settings.root, sizeof settings.root, "%s", root);
  settings.root_length = std::strlen(settings.root);
  settings.kind = kind_of(variable("CNERF_FAULT_KIND"));
  if (settings.kind == Kind::kOff) return;
  std::snprintf(settings.shadow, sizeof settings.shadow, "%s", variable("CNERF_FAULT_SHADOW"));
  std::snprintf(settings.count, sizeof settings.count, "%s", variable("CNERF_FAULT_COUNT"));
  settings.at_end = std::strcmp(variable("CNERF_FAULT_AT"), "end") == 0;
  settings.at = std::atol(variable("CNERF_FAULT_AT"));
  settings.milliseconds = std::atol(variable("CNERF_FAULT_MS"));
  if (*variable("CNERF_FAULT_BYTES") != '\0') settings.large = std::size_t(std::atol(variable("CNERF_FAULT_BYTES")));
  if (*variable("CNERF_FAULT_LOG") != '\0') {
    settings.log = REAL(open)(variable("CNERF_FAULT_LOG"), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0644);
  }
  settings.process = ::getpid();
  unsynced();
  is_active = true;
}

__attribute__((destructor)) void end() {
  if (!counts_here()) return;
  is_in_main = false;
  if (settings.count[0] != '\0') {
    const int file = REAL(open)(settings.count, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    const std::string text = std::to_string(operations.load()) + "\n";
    if (file >= 0) (void)!REAL(write)(file, text.data(), text.size());
  }
  if (keeps_record() && settings.at_end) unsynced().take_back();
  is_active = false;
}

// ---------------------------------------------------------------------------------------------------- memory

/// Whether this allocation is the one that fails.
bool has_no_memory(std::size_t bytes) {
  if (settings.kind != Kind::kMemory || bytes < settings.large) return false;
  if (!is_in_main.load(std::memory_order_relaxed) || !counts_here()) return false;
  const long number = ++operations;
  if (settings.log >= 0) {
    char line[96];
    const int length = std::snprintf(line, sizeof line, "%ld allocate %zu -\n", number, bytes);
    (void)!::write(settings.log, line, std::size_t(length));
  }
  if (number != settings.at) return false;
  errno = ENOMEM;
  return true;
}

int (*main_of_program)(int, char**, char**) = nullptr;
int main_with_memory_counted(int argc, char** argv, char** environment) {
  is_in_main = true;
  return main_of_program(argc, argv, environment);
}

}  // namespace

extern "C" {

// NOLINTNEXTLINE(bugprone-reserved-identifier)
int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(), void (*fini)(),
                      void (*linker_fini)(), void* stack_end) {
  using Start = int(int (*)(int, char**, char**), int, char**, void (*)(), void (*)(), void (*)(), void*);
  main_of_program = main;
  return next_of<Start>("__libc_start_main")(main_with_memory_counted, argc, argv, init, fini, linker_fini, stack_end);
}

void* malloc(std::size_t bytes) noexcept {
  return has_no_memory(bytes) ? nullptr : __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  return has_no_memory(count * size) ? nullptr : __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t bytes) noexcept {
  return has_no_memory(bytes) ? nullptr : __libc_realloc(old, bytes);
}
void* memalign(std::size_t alignment, std::size_t bytes) noexcept {
  return has_no_memory(bytes) ? nullptr : __libc_memalign(alignment, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) noexcept {
  return has_no_memory(bytes) ? nullptr : __libc_memalign(alignment, bytes);
}
int posix_memalign(void** result, std::size_t alignment, std::size_t bytes) noexcept {
  *result = has_no_memory(bytes) ? nullptr : __libc_memalign(alignment, bytes);
  return *result == nullptr ? ENOMEM : 0;
}

#define MODE_OF(flags)                          \
  mode_t mode = 0;                              \
  if (((flags) & (O_CREAT | O_TMPFILE)) != 0) { \
    va_list more;                               \
    va_start(more, flags);                      \
    mode = va_arg(more, mode_t);                \
    va_end(more);                               \
  }

int open(const char* name, int flags, ...) {
  MODE_OF(flags)
  return counted_open(AT_FDCWD, name, flags, [&] { return REAL(open)(name, flags, mode); });
}
int open64(const char* name, int flags, ...) {
  MODE_OF(flags)
  return counted_open(AT_FDCWD, name, flags, [&] { return REAL(open64)(name, flags, mode); });
}
int openat(int folder, const char* name, int flags, ...) {
  MODE_OF(flags)
  return counted_open(folder, name, flags, [&] { return REAL(openat)(folder, name, flags, mode); });
}
int openat64(int folder, const char* name, int flags, ...) {
  MODE_OF(flags)
  return counted_open(folder, name, flags, [&] { return REAL(openat64)(folder, name, flags, mode); });
}
int creat(const char* name, mode_t mode) {
  return open(name, O_WRONLY | O_CREAT | O_TRUNC, mode);
}
int creat64(const char* name, mode_t mode) {
  return open64(name, O_WRONLY | O_CREAT | O_TRUNC, mode);
}
// NOLINTBEGIN(bugprone-reserved-identifier)
int __open_2(const char* name, int flags) {
  return open(name, flags);
}
int __open64_2(const char* name, int flags) {
  return open64(name, flags);
}
int __openat_2(int folder, const char* name, int flags) {
  return openat(folder, name, flags);
}
// NOLINTEND(bugprone-reserved-identifier)

FILE* fopen(const char* name, const char* mode) {
  return counted_fopen(name, mode, [&] { return REAL(fopen)(name, mode); });
}
FILE* fopen64(const char* name, const char* mode) {
  return counted_fopen(name, mode, [&] { return REAL(fopen64)(name, mode); });
}
FILE* fdopen(int file, const char* mode) noexcept {
  FILE* stream = REAL(fdopen)(file, mode);
  if (stream != nullptr && changes_files(flags_of(mode)) && path_of(file)) remember(stream);
  return stream;
}
std::size_t fwrite(const void* data, std::size_t size, std::size_t count, FILE* stream) {
  return is_known(stream) ? fwrite_counted(data, size, count, stream) : REAL(fwrite)(data, size, count, stream);
}
std::size_t fwrite_unlocked(const void* data, std::size_t size, std::size_t count, FILE* stream) {
  return fwrite(data, size, count, stream);
}
int fflush(FILE* stream) {
  return stream != nullptr && is_known(stream) ? flush_counted(stream) : REAL(fflush)(stream);
}
int fclose(FILE* stream) {
  if (!is_known(stream)) return REAL(fclose)(stream);
  const int flushed = flush_counted(stream);
  const int error = errno;
  forget(stream);
  const int closed = REAL(fclose)(stream);
  if (flushed != 0) errno = error;
  return flushed != 0 ? flushed : closed;
}

ssize_t write(int file, const void* data, std::size_t bytes) {
  return counted_write(file, bytes, [&](std::size_t first, std::size_t count) {
    return REAL(write)(file, static_cast<const char*>(data) + first, count);
  });
}
ssize_t pwrite(int file, const void* data, std::size_t bytes, off_t place) {
  return counted_write(file, bytes, [&](std::size_t first, std::size_t count) {
    return REAL(pwrite)(file, static_cast<const char*>(data) + first, count, place + off_t(first));
  });
}
ssize_t pwrite64(int file, const void* data, std::size_t bytes, off64_t place) {
  return pwrite(file, data, bytes, place);
}
ssize_t writev(int file, const iovec* pieces, int count) {
  if (!path_of(file)) return REAL(writev)(file, pieces, count);
  std::string all;
  for (int i = 0; i < count; ++i) all.append(static_cast<const char*>(pieces[i].iov_base), pieces[i].iov_len);
  return write(file, all.data(), all.size());
}
ssize_t sendfile(int to, int from, off_t* place, std::size_t bytes) noexcept {
  return counted_write(to, bytes,
                       [&](std::size_t, std::size_t count) { return REAL(sendfile)(to, from, place, count); });
}
ssize_t sendfile64(int to, int from, off64_t* place, std::size_t bytes) noexcept {
  return sendfile(to, from, place, bytes);
}
ssize_t copy_file_range(int from, off64_t* from_place, int to, off64_t* to_place, std::size_t bytes, unsigned flags) {
  return counted_write(to, bytes, [&](std::size_t, std::size_t count) {
    return REAL(copy_file_range)(from, from_place, to, to_place, count, flags);
  });
}

int ftruncate(int file, off_t length) noexcept {
  const auto path = path_of(file);
  if (!path) return REAL(ftruncate)(file, length);
  const Turn turn;
  return counted(What::kResize, *path, [&] {
    if (keeps_record()) unsynced().file_changes(file, false);
    return REAL(ftruncate)(file, length);
  });
}
int ftruncate64(int file, off64_t length) noexcept {
  return ftruncate(file, length);
}
int truncate(const char* name, off_t length) noexcept {
  const auto path = counted_path(AT_FDCWD, name);
  if (!path) return REAL(truncate)(name, length);
  const Turn turn;
  return counted(What::kResize, *path, [&] { return REAL(truncate)(name, length); });
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) noexcept {
  const auto old_path = counted_path(from_folder, from), new_path = counted_path(to_folder, to);
  if (!new_path) return REAL(renameat2)(from_folder, from, to_folder, to, flags);
  const Turn turn;
  return counted(What::kRename, *new_path, [&] {
    const std::string kept = keeps_record() ? unsynced().keep(*new_path) : std::string();
    const int result = REAL(renameat2)(from_folder, from, to_folder, to, flags);
    if (result == 0 && keeps_record() && old_path) unsynced().renamed(*old_path, *new_path, kept);
    return result;
  });
}
int renameat(int from_folder, const char* from, int to_folder, const char* to) noexcept {
  return renameat2(from_folder, from, to_folder, to, 0);
}
int rename(const char* from, const char* to) noexcept {
  return renameat2(AT_FDCWD, from, AT_FDCWD, to, 0);
}

int unlinkat(int folder, const char* name, int flags) noexcept {
  const auto path = counted_path(folder, name);
  if (!path) return REAL(unlinkat)(folder, name, flags);
  const Turn turn;
  return counted(What::kRemove, *path, [&] {
    const bool is_file = (flags & AT_REMOVEDIR) == 0;
    const std::string kept = keeps_record() && is_file ? unsynced().keep(*path) : std::string();
    const int result = REAL(unlinkat)(folder, name, flags);
    if (result == 0 && keeps_record()) unsynced().removed(*path, kept);
    return result;
  });
}
int unlink(const char* name) noexcept {
  return unlinkat(AT_FDCWD, name, 0);
}
int rmdir(const char* name) noexcept {
  return unlinkat(AT_FDCWD, name, AT_REMOVEDIR);
}
int remove(const char* name) noexcept {
  struct stat state {};
  if (!counted_path(AT_FDCWD, name) || ::lstat(name, &state) != 0) return REAL(remove)(name);
  return unlinkat(AT_FDCWD, name, S_ISDIR(state.st_mode) ? AT_REMOVEDIR : 0);
}

int mkdirat(int folder, const char* name, mode_t mode) noexcept {
  const auto path = counted_path(folder, name);
  struct stat state {};
  if (!path || ::lstat(path->c_str(), &state) == 0) return REAL(mkdirat)(folder, name, mode);
  const Turn turn;
  return counted(What::kMakeFolder, *path, [&] {
    const int result = REAL(mkdirat)(folder, name, mode);
    if (result == 0 && keeps_record()) unsynced().folder_made(*path);
    return result;
  });
}
int mkdir(const char* name, mode_t mode) noexcept {
  return mkdirat(AT_FDCWD, name, mode);
}
int linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) noexcept {
  const auto path = counted_path(to_folder, to);
  if (!path) return REAL(linkat)(from_folder, from, to_folder, to, flags);
  const Turn turn;
  return counted(What::kLink, *path, [&] {
    const int result = REAL(linkat)(from_folder, from, to_folder, to, flags);
    if (result == 0 && keeps_record()) unsynced().created(*path);
    return result;
  });
}
int link(const char* from, const char* to) noexcept {
  return linkat(AT_FDCWD, from, AT_FDCWD, to, 0);
}

int fsync(int file) {
  const auto path = path_of(file);
  // A folder itself may be the root.
  if (!path) return REAL(fsync)(file);
  const Turn turn;
  return counted(What::kSync, *path, [&] {
    if (keeps_record()) unsynced().synced(file, *path);
    return 0;  // nobody really pulls the plug, and tests have no time to wait for disks
  });
}
int fdatasync(int file) {
  return fsync(file);
}

}  // extern "C"
