#include "src/engine/engines.h"

#include "src/base/cpu_features.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

/// Engines of one device: each method calls the function that it is given.
template <Device kDevice, auto Describe, auto MakeLuminance, auto MakeColorBins, auto MakeColorField>
class EnginesOf final : public Engines {
 public:
  [[nodiscard]] Device device() const override { return kDevice; }
  [[nodiscard]] std::string description() const override { return Describe(); }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override {
    return MakeLuminance(options);
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& grid,
                                                                std::uint64_t seed) const override {
    return MakeColorBins(grid, seed);
  }
  [[nodiscard]] std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions& grid,
                                                                   std::uint64_t seed) const override {
    return MakeColorField(grid, seed);
  }
};

std::string processor_text() {
  return std::to_string(thread_count()) + " threads, " + to_string(detected_isa());
}

using CpuEngines = EnginesOf<Device::kCpu, processor_text, make_cpu_luminance_engine, make_cpu_color_bin_engine,
                             make_cpu_color_field_engine>;
#if CNERF_CUDA_ENGINE
using CudaEngines = EnginesOf<Device::kCuda, cuda_device_text, make_cuda_luminance_engine, make_cuda_color_bin_engine,
                              make_cuda_color_field_engine>;
#endif

}  // namespace

const Engines& cpu_engines() {
  static const CpuEngines engines;
  return engines;
}

const Engines* cuda_engines() {
#if CNERF_CUDA_ENGINE
  static const CudaEngines engines;
  return has_cuda_device() ? &engines : nullptr;
#else
  return nullptr;
#endif
}

bool has_cuda_engines() {
  return CNERF_CUDA_ENGINE != 0;
}

const Engines& engines_for(const std::string& device) {
  const Engines* cuda = device == "cpu" ? nullptr : cuda_engines();
  if (cuda != nullptr) return *cuda;
  if (device == "cuda" && !has_cuda_engines()) {
    throw DeviceError("--device cuda: this build has no CUDA engine; pass --device cpu (or auto)");
  }
  if (device == "cuda") {
    throw DeviceError(
        "--device cuda: no GPU that can be used was found, one of NVIDIA's with 150 kB of shared memory per block, as "
        "A100 and H100 have; pass --device cpu (or auto)");
  }
  return cpu_engines();
}

}  // namespace cnerf
