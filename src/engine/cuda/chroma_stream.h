#pragma once
/// The stream of one of stage 2's engines, and what a step of it is told and answers.

#include <cuda_runtime_api.h>

#include "src/base/cuda/device_memory.h"
#include "src/engine/cuda/chroma_kernels.h"

namespace cnerf {

class ChromaStream {
 public:
  ChromaStream() { CNERF_CUDA(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking)); }
  ChromaStream(const ChromaStream&) = delete;
  ChromaStream& operator=(const ChromaStream&) = delete;
  ~ChromaStream() {
    cudaStreamSynchronize(stream_);
    cudaStreamDestroy(stream_);
  }

  operator cudaStream_t() const { return stream_; }  // NOLINT: it is one
  void wait() const { CNERF_CUDA(cudaStreamSynchronize(stream_)); }

  void begin_step(float learning_rate, long step, std::uint32_t samples) const {
    const ChromaStep told{{learning_rate, step}, samples, 0};
    step_.upload(&told, 1, stream_);
  }
  /// The sum of the step's losses; waits for it.
  [[nodiscard]] double end_step() const {
    ChromaStep answer;
    CNERF_CUDA(cudaMemcpyAsync(&answer, step_.data(), sizeof(answer), cudaMemcpyDeviceToHost, stream_));
    wait();
    return answer.loss;
  }
  /// In device memory.
  [[nodiscard]] ChromaStep* step() const { return step_.data(); }

 private:
  cudaStream_t stream_ = nullptr;
  DeviceBuffer<ChromaStep> step_{1, "nets"};
};

}  // namespace cnerf
