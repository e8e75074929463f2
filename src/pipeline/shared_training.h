#pragma once
/// Which ranks of a launch train.

#include "src/cluster/ranks.h"
#include "src/engine/engines.h"

namespace cnerf::pipeline {

/// All on processors. A GPU's engines do not share steps: rank 0 trains alone, and the others wait.
[[nodiscard]] inline cluster::Ranks& ranks_that_train(const Engines& engines) {
  return engines.device() == Device::kCpu ? cluster::world() : cluster::alone();
}
/// Whether this process takes part in a training by `ranks`.
[[nodiscard]] inline bool is_needed(const cluster::Ranks& ranks) {
  return !ranks.is_alone() || cluster::world().is_first();
}

}  // namespace cnerf::pipeline
