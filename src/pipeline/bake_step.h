#pragma once
/// Baking as a step of a run: a take as a volume, a mesh and textures for other programs.

#include <filesystem>
#include <string>

#include "export/bake_output.h"
#include "src/engine/engines.h"
#include "src/pipeline/run_context.h"

namespace cnerf::pipeline {

struct BakeJob {
  std::string take;  ///< empty = grey
  std::filesystem::path folder;
  exporting::Formats formats;
  const Scene* scene = nullptr;  ///< the take's, with the configured finish; null = the step loads it
};

/// Files that would say that a bake of these formats is whole already. The bundle of a stopped one does not: the same
/// command goes on.
[[nodiscard]] std::vector<std::filesystem::path> whole_bakes(const std::filesystem::path& folder,
                                                             const exporting::Formats& formats);
/// Bakes a take and writes the set-up script and the manifest beside it.
void bake_step(const RunContext& context, const BakeJob& job, const Engines& engines, Observer& observer);

/// What is left to do where a bake is finished: a power cut may have brought its journal back.
void end_bake(const RunDirectory& directory, const std::filesystem::path& folder, Observer& observer);

}  // namespace cnerf::pipeline
