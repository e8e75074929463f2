#pragma once
/// Which device trains and renders. Chosen once by the application, as the number of threads is.

#include <memory>
#include <string>

#include "src/engine/chroma_engine.h"
#include "src/engine/luminance_engine.h"

namespace cnerf {

enum class EngineDevice { kCpu, kCuda };

/// @param device  "auto" (a GPU where build and machine have one), "cpu" or "cuda"
/// @throws DeviceError  for "cuda" where this build or this machine has none
void select_engine_device(const std::string& device);
[[nodiscard]] EngineDevice engine_device();

/// Whether this build has the CUDA engine at all.
[[nodiscard]] bool has_cuda_engine();
/// What `doctor` says about it: "not built in", "no usable GPU", or the GPU's name and memory.
[[nodiscard]] std::string cuda_engine_text();

/// The engines of the selected device.
[[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance_engine(const LuminanceEngineOptions& options);
[[nodiscard]] std::unique_ptr<ChromaEngine> make_chroma_engine(const HashGridOptions& grid, std::uint64_t seed);
[[nodiscard]] std::unique_ptr<ChromaticityEngine> make_chromaticity_engine(const HashGridOptions& grid,
                                                                           std::uint64_t seed);

}  // namespace cnerf
