#pragma once
/// A fixed partition of a step's pixels: chunks are worked on in parallel, their sums are added in order, so that a
/// step gives the same bits for any number of threads.

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "src/base/aligned.h"
#include "src/base/parallel.h"
#include "src/engine/step_share.h"
#include "src/field/cpu/hash_grid.h"
#include "src/render/gain_field.h"
#include "src/render/lens_correction.h"
#include "src/render/view_correction.h"

namespace cnerf {

/// Of how many views and lenses something is learned.
struct LearnedCounts {
  std::size_t views = 0, lenses = 0, light = 0;
};

/// What one chunk adds up: gradients to be scattered as runs, weight gradients, losses and counts.
struct StepChunk {
  AlignedVector<float> positions, d_encoded;
  std::size_t groups = 0;
  std::vector<float> d_weights;
  std::vector<ViewGradient> d_views;   ///< where they are learned
  std::vector<LensGradient> d_lenses;  ///< likewise
  std::vector<GainField> d_light;      ///< likewise
  double loss = 0, squared_error = 0;
  std::size_t trained = 0;  ///< samples

  void clear(std::size_t weight_count, const LearnedCounts& learned) {
    groups = trained = 0;
    loss = squared_error = 0;
    d_weights.assign(weight_count, 0.0f);
    d_views.assign(learned.views, {});
    d_lenses.assign(learned.lenses, {});
    d_light.assign(learned.light, {});
  }
  /// Appends a block's positions; returns where its gradient belongs.
  float* append(const AlignedVector<float>& block_positions, std::size_t block_groups, int encoded_channels) {
    const std::size_t group_size = std::size_t(encoded_channels) * kGroup;
    ensure_size(positions, (groups + block_groups) * 3 * kGroup);
    ensure_size(d_encoded, (groups + block_groups) * group_size);
    std::copy_n(block_positions.begin(), block_groups * 3 * kGroup,
                positions.begin() + std::ptrdiff_t(groups * 3 * kGroup));
    float* target = d_encoded.data() + groups * group_size;
    groups += block_groups;
    return target;
  }
};

class StepChunks {
 public:
  static constexpr std::size_t kCount = 32;

  explicit StepChunks(const LearnedCounts& learned = {}) : learned_(learned) {}

  /// Calls `work(chunk, begin, end)` over blocks of at most `block` of `items` items, chunk by chunk.
  template <typename Work>
  void run(std::size_t items, std::size_t block, std::size_t weight_count, Work&& work) {
    const std::size_t blocks = (items + block - 1) / block;
    parallel_tasks(kCount, [&](std::size_t c) {
      chunks_[c].clear(weight_count, learned_);
      for (std::size_t b = c * blocks / kCount; b < (c + 1) * blocks / kCount; ++b) {
        work(chunks_[c], b * block, std::min(items, (b + 1) * block));
      }
    });
  }
  [[nodiscard]] const std::array<StepChunk, kCount>& all() const { return chunks_; }
  [[nodiscard]] std::vector<EncodedSamples> runs() const {
    std::vector<EncodedSamples> all;
    for (const StepChunk& chunk : chunks_) {
      all.push_back({chunk.positions.data(), chunk.d_encoded.data(), chunk.groups});
    }
    return all;
  }
  [[nodiscard]] std::vector<float> d_weights() const {
    std::vector<float> sum(chunks_.front().d_weights.size(), 0.0f);
    for (const StepChunk& chunk : chunks_) {
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += chunk.d_weights[i];
    }
    return sum;
  }
  [[nodiscard]] double loss() const {
    double total = 0;
    for (const StepChunk& chunk : chunks_) total += chunk.loss;
    return total;
  }
  /// Both, over all processes that share the step.
  [[nodiscard]] std::pair<std::vector<float>, double> sums(const StepShare& share) const {
    std::pair<std::vector<float>, double> sums = {d_weights(), loss()};
    if (share.is_whole()) return sums;
    SharedNumbers shared;
    shared.add(sums.first);
    shared.add(float(sums.second));
    shared.sum(share.sum);
    shared.next(sums.first);
    sums.second = shared.next();
    return sums;
  }

 private:
  std::array<StepChunk, kCount> chunks_;
  LearnedCounts learned_;
};

}  // namespace cnerf
