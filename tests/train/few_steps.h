#pragma once
/// A stage 1 that takes a moment.

#include "src/train/luminance/stage1.h"

namespace cnerf::test {

inline Stage1Options few_steps(int steps) {
  Stage1Options options;
  options.grid.levels = 4;
  options.grid.log2_rows = 12;
  options.steps = steps;
  options.samples_per_step = 1 << 12;
  return options;
}

}  // namespace cnerf::test
