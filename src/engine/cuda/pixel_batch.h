#pragma once
/// Pixels of stage 2 in the GPU's memory, and the engines' way through many of them.

#include <cstddef>
#include <span>
#include <vector>

#include "src/base/cuda/device_memory.h"
#include "src/engine/color_engines.h"
#include "src/engine/cuda/chroma_kernels.h"
#include "src/engine/cuda/traced_pixels.h"

namespace cnerf {

class PixelBatch {
 public:
  /// Copies pixels [begin, end) and prepares their samples.
  void upload(const PixelSamples& pixels, std::size_t begin, std::size_t end, cudaStream_t stream);
  /// Takes pixels that lie there already, and prepares their samples. They are referred to.
  void refer_to(const TracedBuffers& pixels, cudaStream_t stream);
  [[nodiscard]] const PixelArrays& arrays() const { return arrays_; }
  [[nodiscard]] std::uint32_t samples() const { return samples_; }

  /// Factors of the pixels' losses in device memory.  @param weights  empty: all 1
  [[nodiscard]] const float* upload_weights(std::span<const float> weights, cudaStream_t stream);

 private:
  void prepare(PixelArrays arrays, std::size_t samples, cudaStream_t stream);

  PixelArrays arrays_;
  std::uint32_t samples_ = 0;
  std::vector<std::uint32_t> host_offsets_;
  std::vector<float> ones_;
  DeviceBuffer<Vec3f> positions_;
  DeviceBuffer<float> weights_, luminance_, shares_, pixel_weights_;
  DeviceBuffer<std::uint32_t> offsets_;
  DeviceBuffer<float4> places_;
};

}  // namespace cnerf
