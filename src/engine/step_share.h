#pragma once
/// A step's pixels, dealt out to several processes that train one field: each works on a range of them, gradients are
/// summed before the optimiser's step, and all fields stay equal bit by bit.

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "src/base/device_sums.h"
#include "src/base/error.h"
#include "src/optim/gradient_sum.h"

namespace cnerf {

/// Pixels of a step of chroma that processes and threads deal out as one: their logits stay in L2.
inline constexpr std::size_t kPixelsPerBlock = 64;

struct StepShare {
  int part = 0, parts = 1;  ///< of the processes
  GradientSum sum = {};
  DeviceSums* on_device = nullptr;  ///< for engines of a GPU, which share no steps without it

  [[nodiscard]] bool is_whole() const { return parts == 1; }
  /// This process's of so many items, in whole blocks: the first one and the one behind the last.
  [[nodiscard]] std::pair<std::size_t, std::size_t> range(std::size_t items, std::size_t block) const {
    const std::size_t blocks = (items + block - 1) / block;
    const auto bound = [&](int p) { return std::min(items, blocks * std::size_t(p) / std::size_t(parts) * block); };
    return {bound(part), bound(part + 1)};
  }
};

/// @throws DeviceError  sums between GPUs that this build lacks
inline void check_sums(const StepShare& share) {
  if (!share.is_whole() && share.on_device == nullptr) {
    throw DeviceError("this build has no sums between GPUs, which therefore share no steps");
  }
}

/// Numbers beside the table's gradient that are summed as one.
class SharedNumbers {
 public:
  void add(float value) { values_.push_back(value); }
  void add(std::span<const float> values) { values_.insert(values_.end(), values.begin(), values.end()); }
  /// In two floats, so that sums below 2^36 are exact.
  void add_count(std::size_t count) {
    for (const std::size_t half : {count / kHalf, count % kHalf}) add(float(half));
  }
  void sum(const GradientSum& sum) { sum(values_); }

  /// In the order of `add`.
  float next() { return values_[read_++]; }
  void next(std::span<float> values) {
    for (float& value : values) value = next();
  }
  std::size_t next_count() {
    const auto high = std::size_t(next());
    return high * kHalf + std::size_t(next());
  }

 private:
  static constexpr std::size_t kHalf = std::size_t(1) << 12;
  std::vector<float> values_;
  std::size_t read_ = 0;
};

}  // namespace cnerf
