#pragma once
/// Which ranks of a launch train.

#include "src/cluster/ranks.h"
#include "src/engine/engines.h"

namespace cnerf::pipeline {

/// A step of this many samples or more is worth sharing between GPUs: of a smaller one the sums take what is gained.
inline constexpr int kSamplesWorthSharing = 1 << 19;

/// All, where each trains on its processors, or each on a GPU and it pays: sums through the host's memory take longer
/// than a GPU alone. Else rank 0 trains, and the others wait. To be called by all.
/// @param samples_per_step  of the training; 0: its engines on GPUs cannot share steps
[[nodiscard]] inline cluster::Ranks& ranks_that_train(const Engines& engines, int samples_per_step) {
  cluster::Ranks& world = cluster::world();
  if (world.is_alone()) return world;
  const bool is_gpu = engines.device() == Device::kCuda;
  if (!world.any(is_gpu)) return world;
  const bool pays = world.sums_on_devices() && samples_per_step >= kSamplesWorthSharing;
  return world.any(!is_gpu || !pays) ? cluster::alone() : world;
}
/// Whether this process takes part in a training by `ranks`.
[[nodiscard]] inline bool is_needed(const cluster::Ranks& ranks) {
  return !ranks.is_alone() || cluster::world().is_first();
}

}  // namespace cnerf::pipeline
