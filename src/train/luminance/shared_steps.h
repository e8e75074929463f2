#pragma once
/// Trainings whose steps several ranks share.

#include <array>

#include "src/cluster/ranks.h"
#include "src/engine/step_share.h"

namespace cnerf {

/// A rank's share of each step.
[[nodiscard]] inline StepShare share_of(cluster::Ranks& ranks) {
  if (ranks.is_alone()) return {};
  return {ranks.rank(), ranks.size(), [&ranks](std::span<float> values) { ranks.sum(values); }, ranks.device_sums()};
}

/// What ranks have to be of one mind about between two steps.
struct CommonMind {
  double seconds = 0;         ///< by rank 0's clock
  bool is_cancelled = false;  ///< by any rank's user

  [[nodiscard]] CommonMind among(cluster::Ranks& ranks) const {
    std::array<double, 2> values = {ranks.is_first() ? seconds : 0.0, is_cancelled ? 1.0 : 0.0};
    ranks.sum(std::span<double>(values));
    return {values[0], values[1] > 0};
  }
};

}  // namespace cnerf
