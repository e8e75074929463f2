#pragma once
/// The trained scene of a run, and what its record says of the steps that look at it.

#include <memory>
#include <string>

#include "src/app/run_directory.h"
#include "src/base/usage.h"
#include "src/train/scene.h"

namespace cnerf {

/// @param take  empty = luminance only.  @throws MissingInputError, SnapshotError.
[[nodiscard]] std::unique_ptr<Scene> load_scene(const RunDirectory& directory, const std::string& take,
                                                const Engines& engines);

/// Who coloured a take; empty when nobody did.
[[nodiscard]] std::string colorizer_name(const RunDirectory& directory, const std::string& take);

/// Keeps in the run's record how long a step took.
void note_time(const RunDirectory& directory, const char* step, const Stopwatch& watch);

}  // namespace cnerf
