/// cnerf doctor: what this machine and build can do, and what is missing.

#include <ImfVersion.h>
#include <OpenEXRConfig.h>
#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <opencv2/core/version.hpp>
#include <set>

#include "src/app/command.h"
#include "src/base/cpu_features.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/base/process.h"
#include "src/colorizer/colorizer.h"
#include "src/config/config.h"
#include "src/engine/engines.h"
#include "src/pipeline/version.h"
#include "viewer/server/page_folder.h"

namespace cnerf::app {
namespace fs = std::filesystem;
namespace {

void line(const std::string& name, const std::string& value) {
  fmt::print("{:<16} {}\n", name + ":", value);
}

/// Shared libraries of this process whose file name contains `part`, links resolved.
std::set<std::string> loaded_libraries(const std::string& part) {
  std::set<std::string> found;
  std::ifstream maps("/proc/self/maps");
  for (std::string text; std::getline(maps, text);) {
    const auto slash = text.find('/');
    if (slash == std::string::npos) continue;
    const fs::path file = text.substr(slash);
    if (file.filename().string().find(part) != std::string::npos) found.insert(file.string());
  }
  return found;
}

/// The BLAS behind Torch decides how fast a colorizer is fitted: the reference one is an order slower.
std::string blas_text() {
  for (const char* kind : {"openblas", "mkl_rt", "libblis"}) {
    if (const auto found = loaded_libraries(kind); !found.empty()) return *found.begin();
  }
  for (const std::string& library : loaded_libraries("libblas")) {
    const bool is_fast = library.find("openblas") != std::string::npos || library.find("atlas") != std::string::npos;
    return library + (is_fast ? "" : "  (reference BLAS: slow; apt install libopenblas0-pthread)");
  }
  return "none found";
}

void print_program(const std::string& name, const std::string& use) {
  const auto found = find_program(name);
  line(name, found ? found->string() : "not found (" + use + ")");
}

std::string memory_text() {
  const double pages = double(::sysconf(_SC_PHYS_PAGES));
  return fmt::format("{:.1f} GiB", pages * double(::sysconf(_SC_PAGESIZE)) / (1 << 30));
}

std::string disk_text() {
  std::error_code failure;
  const fs::space_info space = fs::space(".", failure);
  if (failure) return "unknown: " + failure.message();
  return fmt::format("{:.1f} GiB free here", double(space.available) / (1 << 30));
}

std::string presets_text() {
  std::string text;
  for (const std::string& name : preset_names()) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none found" : text + " in " + preset_file(preset_names().front()).parent_path().string();
}

std::string cuda_text() {
  if (!has_cuda_engines()) return "not built in; fields are trained on the processor";
  const Engines* cuda = cuda_engines();
  return cuda != nullptr ? cuda->description()
                         : "built in, but no GPU that can be used was found; fields are trained on the processor";
}

/// Loads the plug-in that brings LibTorch, and its BLAS with it.
void print_torch() {
  try {
    line("LibTorch", torch_version());
    line("BLAS", blas_text());
  } catch (const DeviceError& problem) {
    line("LibTorch", std::string("cannot be used: ") + problem.what());
  }
}

void doctor() {
  line("cnerf", pipeline::version_text());
  line("processor", cpu_engines().description());
  line("memory", memory_text());
  line("disk", disk_text());
  line("CUDA", cuda_text());
  print_torch();
  line("OpenCV", CV_VERSION);
  line("OpenVDB", CNERF_OPENVDB_VERSION);
  line("OpenEXR", OPENEXR_VERSION_STRING);
  line("presets", presets_text());
  const fs::path page = web::find_page();
  line("viewer page", page.empty() ? "not built (CNERF_VIEWER, npm)" : page.string());
  print_program("blender", "shows bakes");
  print_program("colmap", "finds camera poses");
  print_program("ffmpeg", "cuts videos into pictures");
}

}  // namespace

Work declare_doctor(CLI::App&) {
  return [](const auto&) { doctor(); };
}

}  // namespace cnerf::app
