#pragma once
/// RAII for memory of the GPU, and CUDA calls that throw DeviceError.

#include <cuda_runtime_api.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "src/base/error.h"

namespace cnerf {

/// @throws DeviceError  naming the call and quoting the driver.
inline void cuda_check(cudaError_t result, const char* call) {
  if (result == cudaSuccess) return;
  cudaGetLastError();  // clears the error, which the next call would report again
  throw DeviceError(std::string(call) + ": " + cudaGetErrorString(result));
}
#define CNERF_CUDA(call) ::cnerf::cuda_check((call), #call)

/// Device memory of trivially copyable elements. The constructor and the `upload` without a stream are synchronous:
/// they use the default stream, which the engines' non-blocking streams do not wait for.
template <typename T>
class DeviceBuffer {
 public:
  DeviceBuffer() = default;
  /// Zeroed memory.  @param use  for the error message: what the memory is for, and which option lowers it
  DeviceBuffer(std::size_t size, const std::string& use) : size_(size) {
    if (size == 0) return;
    const cudaError_t result = cudaMalloc(reinterpret_cast<void**>(&data_), size * sizeof(T));
    if (result == cudaErrorMemoryAllocation) {
      cudaGetLastError();
      std::size_t free = 0, total = 0;
      cudaMemGetInfo(&free, &total);
      const auto mib = [](std::size_t bytes) { return std::to_string((bytes + (1u << 20) - 1) >> 20) + " MiB"; };
      throw DeviceError("out of GPU memory: " + mib(size * sizeof(T)) + " wanted for " + use + ", " + mib(free) +
                        " of " + mib(total) + " free");
    }
    cuda_check(result, "cudaMalloc");
    CNERF_CUDA(cudaMemset(data_, 0, size * sizeof(T)));
    CNERF_CUDA(cudaStreamSynchronize(nullptr));
  }
  DeviceBuffer(DeviceBuffer&& other) noexcept { swap(other); }
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    DeviceBuffer moved(std::move(other));
    swap(moved);
    return *this;
  }
  ~DeviceBuffer() { cudaFree(data_); }

  [[nodiscard]] T* data() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t bytes() const { return size_ * sizeof(T); }

  /// Makes room for at least `size` elements. Growing discards the content.
  void reserve(std::size_t size, const std::string& use) {
    if (size_ < size) *this = DeviceBuffer(size + size / 4, use);
  }

  /// Ordered by the stream; `from` may be changed after the call.
  void upload(const T* from, std::size_t count, cudaStream_t stream) const {
    if (count > 0) CNERF_CUDA(cudaMemcpyAsync(data_, from, count * sizeof(T), cudaMemcpyHostToDevice, stream));
  }
  /// Ordered by the stream; `to` is complete once the stream has been waited for.
  void download(T* to, std::size_t count, cudaStream_t stream) const {
    if (count > 0) CNERF_CUDA(cudaMemcpyAsync(to, data_, count * sizeof(T), cudaMemcpyDeviceToHost, stream));
  }

  void upload(const T* from, std::size_t count) const {
    if (count == 0) return;
    CNERF_CUDA(cudaMemcpy(data_, from, count * sizeof(T), cudaMemcpyHostToDevice));
    CNERF_CUDA(cudaStreamSynchronize(nullptr));
  }
  void download(T* to, std::size_t count, std::size_t first = 0) const {
    if (count > 0) CNERF_CUDA(cudaMemcpy(to, data_ + first, count * sizeof(T), cudaMemcpyDeviceToHost));
  }
  [[nodiscard]] std::vector<T> downloaded() const {
    std::vector<T> values(size_);
    download(values.data(), size_);
    return values;
  }

 private:
  void swap(DeviceBuffer& other) {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
  }
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

template <typename T>
[[nodiscard]] DeviceBuffer<T> uploaded(const std::vector<T>& values, const std::string& use) {
  DeviceBuffer<T> buffer(values.size(), use);
  buffer.upload(values.data(), values.size());
  return buffer;
}

/// Host memory that kernels may write to.
template <typename T>
class MappedBuffer {
 public:
  explicit MappedBuffer(std::size_t size) : size_(size) {
    CNERF_CUDA(cudaHostAlloc(reinterpret_cast<void**>(&data_), size * sizeof(T), cudaHostAllocMapped));
    CNERF_CUDA(cudaHostGetDevicePointer(reinterpret_cast<void**>(&on_device_), data_, 0));
    std::fill_n(data_, size, T{});
  }
  MappedBuffer(const MappedBuffer&) = delete;
  MappedBuffer& operator=(const MappedBuffer&) = delete;
  ~MappedBuffer() { cudaFreeHost(data_); }

  T& operator[](std::size_t i) { return data_[i]; }
  const T& operator[](std::size_t i) const { return data_[i]; }
  /// The same memory as kernels address it.
  [[nodiscard]] T* on_device() const { return on_device_; }

 private:
  T* data_ = nullptr;
  T* on_device_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace cnerf
