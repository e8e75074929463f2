#pragma once
/// Pixels that were traced on the GPU, their samples in its memory.

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/base/cuda/device_memory.h"
#include "src/base/parallel.h"
#include "src/engine/pixel_samples.h"

namespace cnerf {

/// See KeptSamples (trace_kernel.h).
struct TracedBuffers {
  std::uint32_t rays = 0, samples = 0;
  DeviceBuffer<Vec3f> positions;
  DeviceBuffer<float> t, weights, luminance;
  DeviceBuffer<std::uint32_t> begins, ends;
  DeviceBuffer<RayResult> results;
};

/// Brings samples to the host in the order of their rays.
class RayOrder {
 public:
  explicit RayOrder(const TracedBuffers& traced);

  [[nodiscard]] const std::vector<std::size_t>& offsets() const { return offsets_; }  ///< [rays + 1]
  /// As they lie in the GPU's memory.
  template <typename T>
  [[nodiscard]] std::vector<T> unordered(const DeviceBuffer<T>& of_samples) const {
    std::vector<T> found(offsets_.back());
    of_samples.download(found.data(), found.size());
    return found;
  }
  /// Calls `move(from, to, count)` for the samples of each ray: where the first of them lies unordered, and in order.
  template <typename Move>
  void for_rays(const Move& move) const {
    constexpr std::size_t kGrain = 512;  // rays of a parallel piece of work
    parallel_each(begins_.size(), kGrain,
                  [&](std::size_t r) { move(begins_[r], offsets_[r], offsets_[r + 1] - offsets_[r]); });
  }
  template <typename T>
  [[nodiscard]] std::vector<T> downloaded(const DeviceBuffer<T>& of_samples) const {
    const std::vector<T> found = unordered(of_samples);
    std::vector<T> ordered(found.size());
    for_rays([&](std::size_t from, std::size_t to, std::size_t count) {
      std::copy_n(found.data() + from, count, ordered.data() + to);
    });
    return ordered;
  }

 private:
  std::vector<std::uint32_t> begins_;
  std::vector<std::size_t> offsets_ = {0};
};

class TracedPixelsCuda final : public TracedPixels {
 public:
  explicit TracedPixelsCuda(std::shared_ptr<const TracedBuffers> buffers);

  [[nodiscard]] std::span<const RayResult> results() const override { return results_; }
  [[nodiscard]] const PixelSamples& samples() const override;
  [[nodiscard]] const TracedBuffers& buffers() const { return *buffers_; }

 private:
  std::shared_ptr<const TracedBuffers> buffers_;
  std::vector<RayResult> results_;
  mutable std::optional<PixelSamples> samples_;
};

}  // namespace cnerf
