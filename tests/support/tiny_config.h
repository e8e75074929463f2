#pragma once
/// A configuration that a pipeline is done with in a second or two.

#include "src/config/config.h"

namespace cnerf::test {

[[nodiscard]] inline Config tiny_config() {
  Config config;
  config.capture.downscale = 2;
  config.stage1.steps = 100;
  config.stage1.samples_per_step = 4096;
  config.stage1.steps_per_box = config.render.steps_per_box = 64;
  config.stage1.grid = {.levels = 4, .log2_rows = 12, .coarsest_resolution = 4, .finest_resolution = 64};
  config.stage2.grid = config.stage1.grid;
  config.stage2.working_resolution = 32;
  return config;
}

}  // namespace cnerf::test
