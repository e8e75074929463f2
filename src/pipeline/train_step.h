#pragma once
/// Stage 1 as a step of a run.

#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {

/// Trains luminance and density, unless that is finished, and says what it wrote.
/// @param resume  go on with a training that was stopped; without it a finished one is made again
/// @throws  as `train_stage1`.
void train_step(const RunContext& context, bool resume, const Engines& engines, Observer& observer);

}  // namespace cnerf::pipeline
