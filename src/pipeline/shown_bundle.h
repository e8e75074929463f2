#pragma once
/// The web bundle of what a user wants to look at.

#include <filesystem>
#include <string>
#include <vector>

#include "export/options.h"
#include "src/base/observer.h"

namespace cnerf::pipeline {

struct ShowJob {
  std::filesystem::path what;             ///< a bundle, a bake, a run, or a file in one of them
  std::string take;                       ///< of a run; empty = the last one
  std::vector<std::string> command_line;  ///< for records
};

/// The bundle to show: what is there, or one made of a bake that has none, or an older one.
/// @throws MissingInputError, InputError; UsageError  a take of what is no run.
[[nodiscard]] std::filesystem::path bundle_to_show(const ShowJob& job, const exporting::WebOptions& options,
                                                   Observer& observer);

}  // namespace cnerf::pipeline
