#pragma once
/// The stream of one of stage 2's engines, with the input and the result of its steps.

#include <cuda_runtime_api.h>

#include "src/base/cuda/stream.h"
#include "src/engine/cuda/chroma_kernels.h"

namespace cnerf {

class ChromaStream {
 public:
  operator cudaStream_t() const { return stream_; }  // NOLINT: it is one
  void wait() const { stream_.wait(); }

  void begin_step(float learning_rate, long step, std::uint32_t samples) const {
    const ChromaStep input{{learning_rate, step}, samples, 0};
    step_.upload(&input, 1, stream_);
  }
  /// The sum of the step's losses; waits for it.  @param others  processes that share the step; null: none
  [[nodiscard]] double end_step(DeviceSums* others) const {
    if (others != nullptr) others->sum(std::span(&step_.data()->loss, 1), stream_);
    ChromaStep result;
    step_.download(&result, 1, stream_);
    wait();
    return result.loss;
  }
  /// In device memory.
  [[nodiscard]] ChromaStep* step() const { return step_.data(); }

 private:
  CudaStream stream_;
  DeviceBuffer<ChromaStep> step_{1, "nets"};
};

}  // namespace cnerf
