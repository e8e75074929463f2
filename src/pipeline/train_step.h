#pragma once
/// Stage 1 as a step of a run.

#include <functional>

#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"
#include "src/train/luminance/luminance_model.h"

namespace cnerf::pipeline {

struct TrainJob {
  bool resume = false;  ///< go on with a training that was stopped; without it a finished one is made again
  std::function<void(const LuminanceModel&)> watch = {};  ///< as Stage1Job has it
};

/// Trains luminance and density, unless that is finished, and says what it wrote.
/// @throws  as `train_stage1`.
void train_step(const RunContext& context, const TrainJob& job, const Engines& engines, Observer& observer);

}  // namespace cnerf::pipeline
