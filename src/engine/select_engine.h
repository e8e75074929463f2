#pragma once
/// Which device trains, renders and bakes. Chosen once by the application, as the number of threads is.

#include <functional>
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

/// Who makes the engines of a training: the selected device, unless a comparison puts another kind of field, or an
/// observer, behind the same interfaces. A snapshot is to be read with the makers that it was written with.
struct EngineMakers {
  std::function<std::unique_ptr<LuminanceEngine>(const LuminanceEngineOptions& options)> luminance =
      make_luminance_engine;
  std::function<std::unique_ptr<ChromaEngine>(const HashGridOptions& grid, std::uint64_t seed)> chroma =
      make_chroma_engine;
};

}  // namespace cnerf
