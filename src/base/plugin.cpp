#include "src/base/plugin.h"

#include <dlfcn.h>

#include <filesystem>
#include <vector>

#include "src/base/error.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

std::vector<fs::path> plugin_folders() {
  std::vector<fs::path> folders;
  std::error_code failure;
  if (const fs::path program = fs::read_symlink("/proc/self/exe", failure); !failure) {
    folders.push_back(program.parent_path());
    folders.push_back(program.parent_path().parent_path() / "lib" / "cnerf");
  }
  folders.emplace_back(CNERF_PLUGIN_FOLDER);
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

void* plugin_symbol(const std::string& plugin, const std::string& symbol) {
  const fs::path file = program_part("libcnerf_" + plugin + ".so");
  void* library = ::dlopen(file.c_str(), RTLD_LAZY | RTLD_LOCAL);  // a second time gives the first one's handle
  if (library == nullptr) throw DeviceError(file.string() + " cannot be loaded: " + ::dlerror());
  void* address = ::dlsym(library, symbol.c_str());
  if (address == nullptr) throw DeviceError(file.string() + " is of another version: it has no " + symbol);
  return address;
}

}  // namespace cnerf
