#include <ImfVersion.h>
#include <OpenEXRConfig.h>
#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <opencv2/core/version.hpp>
#include <set>

#include "src/base/error.h"
#include "src/base/process.h"
#include "src/base/text.h"
#include "src/colorizer/colorizer.h"
#include "src/config/config.h"
#include "src/engine/engines.h"
#include "src/pipeline/facts.h"
#include "src/pipeline/version.h"
#include "viewer/server/page_folder.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;
namespace {

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

Fact program_fact(const std::string& name, const std::string& use) {
  const auto found = find_program(name);
  return {name, found ? found->string() : "not found (" + use + ")"};
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
  const std::vector<std::string> names = preset_names();
  if (names.empty()) return "none found";
  return joined(names, ", ") + " in " + preset_file(names.front()).parent_path().string();
}

std::string cuda_text() {
  if (!has_cuda_engines()) return "not built in; fields are trained on the processor";
  const Engines* cuda = cuda_engines();
  return cuda != nullptr ? cuda->description()
                         : "built in, but no GPU that can be used was found; fields are trained on the processor";
}

/// Loads the plug-in that brings LibTorch, and its BLAS with it.
std::vector<Fact> torch_facts() {
  try {
    return {{"LibTorch", torch_version()}, {"BLAS", blas_text()}};
  } catch (const DeviceError& problem) {
    return {{"LibTorch", std::string("cannot be used: ") + problem.what()}};
  }
}

std::string onnx_text() {
  try {
    return onnx_engine();
  } catch (const DeviceError& problem) {
    return std::string("cannot be used: ") + problem.what();
  }
}

}  // namespace

std::vector<Fact> facts_of_machine() {
  std::vector<Fact> facts = {{"cnerf", version_text()},
                             {"processor", cpu_engines().description()},
                             {"memory", memory_text()},
                             {"disk", disk_text()},
                             {"CUDA", cuda_text()}};
  for (Fact& fact : torch_facts()) facts.push_back(std::move(fact));
  const fs::path page = web::find_page();
  for (const Fact& fact : {Fact{"OpenCV", CV_VERSION}, Fact{"onnx: networks", "run by " + onnx_text()},
                           Fact{"OpenVDB", CNERF_OPENVDB_VERSION}, Fact{"OpenEXR", OPENEXR_VERSION_STRING},
                           Fact{"presets", presets_text()},
                           Fact{"viewer page", page.empty() ? "not built (CNERF_VIEWER, npm)" : page.string()},
                           program_fact("blender", "shows bakes"), program_fact("colmap", "finds camera poses"),
                           program_fact("ffmpeg", "cuts videos into pictures")}) {
    facts.push_back(fact);
  }
  return facts;
}

}  // namespace cnerf::pipeline
