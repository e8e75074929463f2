#pragma once
/// Arrays of samples in groups of 16: channel c of sample 16 g + i lies at (g C + c) 16 + i, so that one channel of a
/// group is one AVX-512 register. Comments write such an array as [G, C, 16].

#include <cstddef>

#include "src/base/aligned.h"

namespace cnerf {

inline constexpr int kGroup = 16;  ///< samples per group

/// Groups that hold so many samples; the last one is padded.
[[nodiscard]] constexpr std::size_t groups_of(std::size_t samples) {
  return (samples + kGroup - 1) / kGroup;
}

/// An array [G, C, 16] by sample and channel.
template <typename T>
class GroupedView {
 public:
  GroupedView(T* data, int channels) : data_(data), channels_(std::size_t(channels)) {}
  template <typename Values>
  requires requires(Values& values) { values.data(); }
  GroupedView(Values& values, int channels) : GroupedView(values.data(), channels) {}

  [[nodiscard]] T& at(std::size_t sample, int channel) const {
    return data_[(sample / kGroup * channels_ + std::size_t(channel)) * kGroup + sample % kGroup];
  }

 private:
  T* data_;
  std::size_t channels_;
};

}  // namespace cnerf
