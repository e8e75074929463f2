#pragma once
/// The engines of a device: everything that trains, queries and renders fields comes from here. Whoever needs one is
/// handed the `Engines` to use; there is no device of the process.

#include <cstdint>
#include <memory>
#include <string>

#include "src/base/cpu_features.h"
#include "src/engine/color_engines.h"
#include "src/engine/luminance_engine.h"

namespace cnerf {

enum class Device { kCpu, kCuda };

/// Makes engines. A snapshot is to be read with engines of the kind that it was written with; those of the processor
/// and of a GPU read each other's.
class Engines {
 public:
  virtual ~Engines() = default;
  [[nodiscard]] virtual Device device() const = 0;
  /// For people: "16 threads, AVX-512", or the GPU's name and memory.
  [[nodiscard]] virtual std::string description() const = 0;

  /// All three: @throws DeviceError  when the device is not usable, or its memory does not suffice.
  [[nodiscard]] virtual std::unique_ptr<LuminanceEngine> make_luminance(
      const LuminanceEngineOptions& options) const = 0;
  [[nodiscard]] virtual std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& grid,
                                                                        std::uint64_t seed) const = 0;
  [[nodiscard]] virtual std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions& grid,
                                                                           std::uint64_t seed) const = 0;
};

/// The processor's.
[[nodiscard]] const Engines& cpu_engines();
/// The GPU's; null in builds without CUDA and on machines without a usable GPU.
[[nodiscard]] const Engines* cuda_engines();
/// What they compute with, as snapshots name it: "cuda", or the instruction set of the processor's kernels.
[[nodiscard]] inline std::string kernels_of(const Engines& engines) {
  return engines.device() == Device::kCuda ? "cuda" : to_string(active_isa());
}
/// @param device  "auto" (a GPU where build and machine have one), "cpu" or "cuda"
/// @throws DeviceError  for "cuda" where this build or this machine has none
[[nodiscard]] const Engines& engines_for(const std::string& device);

/// Whether this build has the CUDA engines at all.
[[nodiscard]] bool has_cuda_engines();

}  // namespace cnerf
