#include "src/base/plugin.h"

#include <dlfcn.h>
#include <link.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <mutex>
#include <new>

#include "src/base/error.h"
#include "src/base/progress.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// The folder of the file that holds this code: a program or a shared library; empty where the system does not say.
fs::path own_folder() {
  Dl_info info;
  link_map* object = nullptr;
  const bool is_known = ::dladdr1(reinterpret_cast<const void*>(&own_folder), &info, reinterpret_cast<void**>(&object),
                                  RTLD_DL_LINKMAP) != 0;
  // The loader's name of the program itself is empty.
  const bool is_program = !is_known || object == nullptr || *object->l_name == '\0';
  std::error_code failure;
  return fs::canonical(is_program ? "/proc/self/exe" : object->l_name, failure).parent_path();
}

/// The root of the installation that a file in `folder` is part of.
fs::path installation_of(const fs::path& folder) {
  const std::string path = folder.string();
  for (const std::string place : {"/" CNERF_LIBRARY_FOLDER, "/" CNERF_PYTHON_FOLDER}) {
    if (path.ends_with(place)) return path.substr(0, path.size() - place.size());
  }
  return folder.parent_path();  // bin
}

std::vector<fs::path> plugin_folders() {
  std::vector<fs::path> folders = {CNERF_PLUGIN_HOME};
  if (const fs::path own = own_folder(); !own.empty()) {
    folders.insert(folders.begin(), {own, installation_of(own) / CNERF_LIBRARY_FOLDER});
  }
  return folders;
}

bool is_memory_limited() {
  const auto is_limited = [](auto what) {
    rlimit limit{};
    return ::getrlimit(what, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
  };
  return is_limited(RLIMIT_DATA) || is_limited(RLIMIT_AS);
}

/// While it lives, a crash ends the program as a shortage of memory does: libraries that cannot have what they begin
/// with abort, or, under a limit, use what they did not get (GDAL, which OpenCV loads). One thread at a time: the last
/// one would leave the other's handlers behind.
class CrashIsShortageOfMemory {
 public:
  CrashIsShortageOfMemory()
      : lock_(one_at_a_time()), before_abort_(std::signal(SIGABRT, end)), before_fault_(std::signal(SIGSEGV, end)) {
    if (!is_memory_limited()) std::signal(SIGSEGV, before_fault_);  // a fault of another kind
  }
  ~CrashIsShortageOfMemory() {
    std::signal(SIGABRT, before_abort_);
    std::signal(SIGSEGV, before_fault_);
  }
  CrashIsShortageOfMemory(const CrashIsShortageOfMemory&) = delete;
  CrashIsShortageOfMemory& operator=(const CrashIsShortageOfMemory&) = delete;

 private:
  static std::recursive_mutex& one_at_a_time() {
    static std::recursive_mutex mutex;  // a plug-in may begin another
    return mutex;
  }
  static void end(int) {
    constexpr char kMessage[] = "\ncnerf: error: out of memory while a library was loaded\n";
    (void)!::write(STDERR_FILENO, kMessage, std::strlen(kMessage));
    ::_exit(int(ExitCode::kMemory));
  }

  std::lock_guard<std::recursive_mutex> lock_;
  void (*before_abort_)(int);
  void (*before_fault_)(int);
};

/// The library of a plug-in; a second time gives the first one's handle.
void* loaded(const fs::path& file) {
  void* library = ::dlopen(file.c_str(), RTLD_LAZY | RTLD_LOCAL);
  if (library != nullptr) return library;
  const std::string reason = ::dlerror();
  for (const char* shortage : {"segment from shared object", "zero-fill pages", "allocate memory"}) {
    if (reason.ends_with(shortage)) throw std::bad_alloc();
  }
  throw DeviceError(file.string() + " cannot be loaded: " + reason);
}

}  // namespace

fs::path program_part(const std::string& name) {
  std::string looked;
  for (const fs::path& folder : plugin_folders()) {
    if (fs::exists(folder / name)) return folder / name;
    looked += " " + folder.string();
  }
  throw DeviceError(name + ", a part of this program, is missing; looked in" + looked);
}

std::vector<fs::path> data_places(const std::string& name) {
  std::vector<fs::path> places = {fs::path(CNERF_DATA_HOME) / name};
  if (const fs::path own = own_folder(); !own.empty()) {
    places.insert(places.begin(), installation_of(own) / "share" / "cnerf" / name);
  }
  return places;
}

const void* begun_plugin(const std::string& plugin, const std::string& entry, const void* (*call)(void* entry)) {
  const CrashIsShortageOfMemory guard;
  const fs::path file = program_part("libcnerf_" + plugin + ".so");
  void* library = loaded(file);
  if (void* follow = ::dlsym(library, "cnerf_follow_interruption"); follow != nullptr) {
    reinterpret_cast<void (*)(std::atomic<int>*)>(follow)(interruption_flag());
  }
  void* address = ::dlsym(library, entry.c_str());
  if (address == nullptr) throw DeviceError(file.string() + " is of another version: it has no " + entry);
  return call(address);
}

}  // namespace cnerf
