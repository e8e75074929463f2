#include "src/engine/engines.h"

#include "src/base/cpu_features.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

class CpuEngines final : public Engines {
 public:
  [[nodiscard]] Device device() const override { return Device::kCpu; }
  [[nodiscard]] std::string description() const override {
    return std::to_string(thread_count()) + " threads, " + to_string(detected_isa());
  }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override {
    return make_cpu_luminance_engine(options);
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& grid,
                                                                std::uint64_t seed) const override {
    return make_cpu_color_bin_engine(grid, seed);
  }
  [[nodiscard]] std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions& grid,
                                                                   std::uint64_t seed) const override {
    return make_cpu_color_field_engine(grid, seed);
  }
};

#if CNERF_CUDA_ENGINE
class CudaEngines final : public Engines {
 public:
  [[nodiscard]] Device device() const override { return Device::kCuda; }
  [[nodiscard]] std::string description() const override { return cuda_device_text(); }
  [[nodiscard]] std::unique_ptr<LuminanceEngine> make_luminance(const LuminanceEngineOptions& options) const override {
    return make_cuda_luminance_engine(options);
  }
  [[nodiscard]] std::unique_ptr<ColorBinEngine> make_color_bins(const HashGridOptions& grid,
                                                                std::uint64_t seed) const override {
    return make_cuda_color_bin_engine(grid, seed);
  }
  [[nodiscard]] std::unique_ptr<ColorFieldEngine> make_color_field(const HashGridOptions& grid,
                                                                   std::uint64_t seed) const override {
    return make_cuda_color_field_engine(grid, seed);
  }
};
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
