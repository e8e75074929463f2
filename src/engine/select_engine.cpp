#include "src/engine/select_engine.h"

#include <atomic>

#include "src/base/error.h"

namespace cnerf {
namespace {

std::atomic<EngineDevice> selected = EngineDevice::kCpu;  // NOLINT: a setting of the process, like its threads

}  // namespace

#if !CNERF_CUDA_ENGINE
// What luminance_engine.h and chroma_engine.h declare for builds with CUDA.
bool has_cuda_device() {
  return false;
}
std::string cuda_device_text() {
  return "";
}
std::unique_ptr<LuminanceEngine> make_cuda_luminance_engine(const LuminanceEngineOptions&) {
  throw DeviceError("this build has no CUDA engine");
}
std::unique_ptr<ChromaEngine> make_cuda_chroma_engine(const HashGridOptions&, std::uint64_t) {
  throw DeviceError("this build has no CUDA engine");
}
std::unique_ptr<ChromaticityEngine> make_cuda_chromaticity_engine(const HashGridOptions&, std::uint64_t) {
  throw DeviceError("this build has no CUDA engine");
}
#endif

bool has_cuda_engine() {
  return CNERF_CUDA_ENGINE != 0;
}

void select_engine_device(const std::string& device) {
  if (device == "cuda" && !has_cuda_engine()) {
    throw DeviceError("--device cuda: this build has no CUDA engine; pass --device cpu (or auto)");
  }
  if (device == "cuda" && !has_cuda_device()) {
    throw DeviceError("--device cuda: no GPU that can be used was found; pass --device cpu (or auto)");
  }
  selected = device != "cpu" && has_cuda_device() ? EngineDevice::kCuda : EngineDevice::kCpu;
}

EngineDevice engine_device() {
  return selected;
}

std::string cuda_engine_text() {
  if (!has_cuda_engine()) return "not built in; fields are trained on the processor";
  if (!has_cuda_device()) return "built in, but no GPU that can be used was found; fields are trained on the processor";
  return cuda_device_text();
}

std::unique_ptr<LuminanceEngine> make_luminance_engine(const LuminanceEngineOptions& options) {
  return selected == EngineDevice::kCuda ? make_cuda_luminance_engine(options) : make_cpu_luminance_engine(options);
}

std::unique_ptr<ChromaEngine> make_chroma_engine(const HashGridOptions& grid, std::uint64_t seed) {
  return selected == EngineDevice::kCuda ? make_cuda_chroma_engine(grid, seed) : make_cpu_chroma_engine(grid, seed);
}

std::unique_ptr<ChromaticityEngine> make_chromaticity_engine(const HashGridOptions& grid, std::uint64_t seed) {
  return selected == EngineDevice::kCuda ? make_cuda_chromaticity_engine(grid, seed)
                                         : make_cpu_chromaticity_engine(grid, seed);
}

}  // namespace cnerf
