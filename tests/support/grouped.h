#pragma once
/// Between arrays of samples [n, C] and the engine's grouped arrays [G, C, 16].

#include <vector>

#include "encoding/cpu/grouped.h"

namespace cnerf::test {

template <typename T>
AlignedVector<float> to_groups(const std::vector<T>& samples, int channels, float padding = 0.5f) {
  const std::size_t n = samples.size() / std::size_t(channels);
  AlignedVector<float> grouped(groups_of(n) * std::size_t(channels) * kGroup, padding);
  const GroupedView<float> view(grouped, channels);
  for (std::size_t s = 0; s < n; ++s) {
    for (int c = 0; c < channels; ++c) view.at(s, c) = float(samples[s * std::size_t(channels) + std::size_t(c)]);
  }
  return grouped;
}

inline std::vector<float> from_groups(const AlignedVector<float>& grouped, int channels, std::size_t n) {
  const GroupedView<const float> view(grouped, channels);
  std::vector<float> samples;
  for (std::size_t s = 0; s < n; ++s) {
    for (int c = 0; c < channels; ++c) samples.push_back(view.at(s, c));
  }
  return samples;
}

}  // namespace cnerf::test
