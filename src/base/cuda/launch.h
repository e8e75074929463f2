#pragma once
/// How many blocks a kernel is launched with. Driver queries are cached, since every launch needs them.

#include <algorithm>

#include "src/base/cuda/device_memory.h"

namespace cnerf {

/// Blocks of `threads` threads that cover so many items.
constexpr unsigned blocks_for(std::size_t items, unsigned threads) {
  return unsigned((items + threads - 1) / threads);
}

inline int multiprocessors() {
  static const int count = [] {
    int device = 0, found = 0;
    CNERF_CUDA(cudaGetDevice(&device));
    CNERF_CUDA(cudaDeviceGetAttribute(&found, cudaDevAttrMultiProcessorCount, device));
    return found;
  }();
  return count;
}

/// The number of blocks of a kernel that fill the GPU. Also raises the kernel's limit of shared memory.
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
