#include <ImfVersion.h>
#include <OpenEXRConfig.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <opencv2/core/version.hpp>

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

/// The BLAS that LibTorch calls decides how fast a colorizer is fitted. It is the first one that the program loaded,
/// whatever LibTorch itself was linked to; LibTorch may hold one of its own instead.
std::string blas_text() {
  Dl_info source{};
  const void* product = ::dlsym(RTLD_DEFAULT, "sgemm_");
  if (product == nullptr || ::dladdr(product, &source) == 0) return "LibTorch's own";
  const std::string library = fs::weakly_canonical(source.dli_fname).string();
  for (const char* kind : {"openblas", "atlas", "mkl", "blis"}) {
    if (library.find(kind) != std::string::npos) return library;
  }
  return library + "  (reference BLAS: slow; apt install libopenblas0-pthread)";
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
