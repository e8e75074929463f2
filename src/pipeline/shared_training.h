#pragma once
/// Which ranks of a launch train.

#include "src/cluster/ranks.h"
#include "src/engine/engines.h"

namespace cnerf::pipeline {

/// A step of stage 1 of this many samples or more is worth sharing between GPUs: of a smaller one the sums take what is
/// gained.
inline constexpr int kSamplesWorthSharing = 1 << 19;

/// All, where each trains on its processors, or each on a GPU and these can sum. Else rank 0 trains, and the others
/// wait. To be called by all.
/// @param pays  whether sums between GPUs take less than they spare
[[nodiscard]] inline cluster::Ranks& ranks_that_train(const Engines& engines, bool pays) {
  cluster::Ranks& world = cluster::world();
  if (world.is_alone()) return world;
  const bool is_gpu = engines.device() == Device::kCuda;
  if (!world.any(is_gpu)) return world;
  return world.any(!is_gpu || world.device_sums() == nullptr || !pays) ? cluster::alone() : world;
}
/// Whether this process takes part in a training by `ranks`.
[[nodiscard]] inline bool is_needed(const cluster::Ranks& ranks) {
  return !ranks.is_alone() || cluster::world().is_first();
}

}  // namespace cnerf::pipeline
