#pragma once
/// All steps of a run, one after another.

#include <filesystem>
#include <string>
#include <vector>

#include "src/pipeline/bake_step.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {

struct RunJob {
  std::filesystem::path capture;  ///< or photographs, or a clip: then it is prepared first
  std::filesystem::path out;      ///< folder of the run
  bool grey = false;              ///< no colours
  exporting::Formats formats;
  ExistingOutput existing;
  std::vector<std::string> command_line;  ///< for records
};

/// A capture in, a coloured volume, metrics and a turntable out, in this order.
/// @return  the folder of the bake
/// @throws  as the steps; what cannot be read or made is found before the training.
std::filesystem::path run(RunJob job, Config config, const Engines& engines, Observer& observer);

}  // namespace cnerf::pipeline
