#pragma once
/// A trainable hash grid on the CPU: the table, its gradient and its optimiser state.

#include <cstdint>
#include <string>
#include <vector>

#include "encoding/cpu/hash_grid_kernels.h"
#include "encoding/hash_grid_levels.h"
#include "src/base/aligned.h"
#include "src/field/state.h"
#include "src/optim/gradient_sum.h"
#include "src/optim/row_adam.h"

namespace cnerf {

/// A run of samples whose gradients are scattered into the table.
struct EncodedSamples {
  const float* positions;  ///< [G, 3, 16]
  const float* d_encoded;  ///< [G, channels, 16]
  std::size_t groups;
};

class HashGridCpu {
 public:
  HashGridCpu(const HashGridOptions& options, std::uint64_t seed);

  [[nodiscard]] int channels() const { return 4 * int(levels_.size()); }
  [[nodiscard]] const std::vector<GridLevel>& levels() const { return levels_; }

  /// @param encoded  [G, channels(), 16]
  void encode(const float* positions, std::size_t groups, float* encoded) const {
    kernels_->encode(levels_.data(), levels_.size(), table_.data(), positions, groups, encoded, channels());
  }
  /// Scatters all runs and applies Adam, one task per level: a level's rows stay in one core's cache, and sums are made
  /// in the order of the runs for any number of threads.
  /// @param sum  between the two, of the whole table's gradient
  void backward_and_update(const std::vector<EncodedSamples>& runs, const AdamStep& step, const GradientSum& sum = {});
  /// @param levels  that count, coarsest first
  void position_gradient(int levels, const float* positions, const float* d_encoded, std::size_t groups,
                         float* d_positions) const {
    kernels_->position_gradient(levels_.data(), std::size_t(levels), table_.data(), positions, d_encoded, groups,
                                channels(), d_positions);
  }
  void append_state(const std::string& prefix, std::vector<StatePiece>& state);

 private:
  void scatter(std::size_t level, const std::vector<EncodedSamples>& runs);
  void update(std::size_t level, const AdamStep& step);

  std::vector<GridLevel> levels_;
  float decay_;
  const HashGridKernels* kernels_;
  AlignedVector<float> table_;    ///< [rows, 4]
  AlignedVector<float> d_table_;  ///< [rows, 4], zero between steps
  AlignedVector<float> moments_;  ///< [rows, 8]
};

}  // namespace cnerf
