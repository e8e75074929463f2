#pragma once
/// How many blocks a kernel is launched with. Calls of every launch: what the driver says is asked for once.

#include <algorithm>

#include "src/base/cuda/device_memory.h"

namespace cnerf {

inline int multiprocessors() {
  static const int count = [] {
    int device = 0, found = 0;
    CNERF_CUDA(cudaGetDevice(&device));
    CNERF_CUDA(cudaDeviceGetAttribute(&found, cudaDevAttrMultiProcessorCount, device));
    return found;
  }();
  return count;
}

/// Blocks of a kernel that fill the GPU; allows it that much shared memory.
template <auto kKernel>
unsigned resident_blocks(int threads, std::size_t shared_bytes) {
  static const unsigned blocks = [&] {
    CNERF_CUDA(cudaFuncSetAttribute(reinterpret_cast<const void*>(kKernel), cudaFuncAttributeMaxDynamicSharedMemorySize,
                                    int(shared_bytes)));
    int of_one = 0;
    CNERF_CUDA(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&of_one, kKernel, threads, shared_bytes));
    return unsigned(std::max(of_one, 1) * multiprocessors());
  }();
  return blocks;
}

}  // namespace cnerf
