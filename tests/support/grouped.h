#pragma once
/// Between arrays of samples [n, C] and the engine's grouped arrays [G, C, 16].

#include <vector>

#include "encoding/cpu/hash_grid_kernels.h"
#include "src/base/aligned.h"

namespace cnerf::test {

inline std::size_t groups_of(std::size_t n) {
  return (n + kGroup - 1) / kGroup;
}

template <typename T>
AlignedVector<float> to_groups(const std::vector<T>& samples, int channels, float padding = 0.5f) {
  const std::size_t n = samples.size() / std::size_t(channels);
  AlignedVector<float> grouped(groups_of(n) * std::size_t(channels) * kGroup, padding);
  for (std::size_t s = 0; s < n; ++s) {
    for (int c = 0; c < channels; ++c) {
      grouped[(s / kGroup * channels + c) * kGroup + s % kGroup] = float(samples[s * channels + c]);
    }
  }
  return grouped;
}

inline std::vector<float> from_groups(const AlignedVector<float>& grouped, int channels, std::size_t n) {
  std::vector<float> samples(n * std::size_t(channels));
  for (std::size_t s = 0; s < n; ++s) {
    for (int c = 0; c < channels; ++c) {
      samples[s * channels + c] = grouped[(s / kGroup * channels + c) * kGroup + s % kGroup];
    }
  }
  return samples;
}

}  // namespace cnerf::test
