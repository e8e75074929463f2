#include "src/base/plugin.h"

#include <dlfcn.h>

#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// The folder that the running program lies in; empty where the system does not say.
fs::path program_folder() {
  std::error_code failure;
  return fs::read_symlink("/proc/self/exe", failure).parent_path();
}

std::vector<fs::path> plugin_folders() {
  std::vector<fs::path> folders = {CNERF_PLUGIN_HOME};
  if (const fs::path program = program_folder(); !program.empty()) {
    folders.insert(folders.begin(), {program, program.parent_path() / "lib" / "cnerf"});
  }
  return folders;
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
  if (const fs::path program = program_folder(); !program.empty()) {
    places.insert(places.begin(), program.parent_path() / "share" / "cnerf" / name);
  }
  return places;
}

void* plugin_symbol(const std::string& plugin, const std::string& symbol) {
  const fs::path file = program_part("libcnerf_" + plugin + ".so");
  void* library = ::dlopen(file.c_str(), RTLD_LAZY | RTLD_LOCAL);  // a second time gives the first one's handle
  if (library == nullptr) throw DeviceError(file.string() + " cannot be loaded: " + ::dlerror());
  void* address = ::dlsym(library, symbol.c_str());
  if (address == nullptr) throw DeviceError(file.string() + " is of another version: it has no " + symbol);
  return address;
}

}  // namespace cnerf
