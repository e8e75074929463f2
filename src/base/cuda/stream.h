#pragma once
/// RAII for streams and events of the GPU.

#include <cuda_runtime_api.h>

#include "src/base/cuda/device_memory.h"

namespace cnerf {

/// A queue of work that runs in order, concurrently with other streams.
class CudaStream {
 public:
  CudaStream() { CNERF_CUDA(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking)); }
  CudaStream(const CudaStream&) = delete;
  CudaStream& operator=(const CudaStream&) = delete;
  ~CudaStream() {
    cudaStreamSynchronize(stream_);
    cudaStreamDestroy(stream_);
  }
  operator cudaStream_t() const { return stream_; }  // NOLINT: it is one
  void wait() const { CNERF_CUDA(cudaStreamSynchronize(stream_)); }

 private:
  cudaStream_t stream_ = nullptr;
};

/// A point in a stream's work that others may wait for.
class CudaEvent {
 public:
  CudaEvent() { CNERF_CUDA(cudaEventCreateWithFlags(&event_, cudaEventDisableTiming)); }
  CudaEvent(const CudaEvent&) = delete;
  CudaEvent& operator=(const CudaEvent&) = delete;
  ~CudaEvent() { cudaEventDestroy(event_); }

  void record(cudaStream_t stream) const { CNERF_CUDA(cudaEventRecord(event_, stream)); }
  void wait() const { CNERF_CUDA(cudaEventSynchronize(event_)); }
  /// Makes a stream wait, not the caller.
  void hold(cudaStream_t stream) const { CNERF_CUDA(cudaStreamWaitEvent(stream, event_, 0)); }

 private:
  cudaEvent_t event_ = nullptr;
};

}  // namespace cnerf
