#pragma once
/// Evaluation as a step of a run.

#include <filesystem>
#include <string>

#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {

struct EvaluateJob {
  std::string take;                     ///< empty = luminance only
  std::filesystem::path lpips_weights;  ///< see `Lpips`; empty = LPIPS is not measured
  bool aligned = false;                 ///< fit the poses of held-out views also where cameras stayed as given
  const Scene* scene = nullptr;         ///< the take's, without a finish; null = the step loads it
};

/// Measures a take and writes metrics.json and the contact sheet.
void evaluate_step(const RunContext& context, const EvaluateJob& job, const Engines& engines, Observer& observer);

}  // namespace cnerf::pipeline
