#pragma once
/// What the commands that work on an existing run share.

#include <string>
#include <vector>

#include "src/app/common_options.h"
#include "src/pipeline/run_context.h"

namespace cnerf::app {

struct RunFolderArguments {
  ConfigArguments config;
  std::string run;
  std::string capture;  ///< where the capture lies now; empty = where it was
  std::string take;     ///< empty = the current one
};

/// Declares RUN, --capture, --take and the config options.
void add_run_folder_options(CLI::App& app, RunFolderArguments& arguments);

/// Opens the run, its configuration (of `take` where it has one) changed by the arguments, and its capture.
/// @throws MissingInputError, SnapshotError, UsageError, InputError; also when stage 1 is not finished.
[[nodiscard]] pipeline::RunContext open_run(const RunFolderArguments& arguments, const std::string& take,
                                            std::vector<std::string> command_line, Reporter& reporter);

/// The same of a run whose stage 1 may not be finished: what it learned of views is not in the capture then.
[[nodiscard]] pipeline::RunContext open_begun_run(const RunFolderArguments& arguments, const std::string& take,
                                                  std::vector<std::string> command_line, Reporter& reporter);

/// Where a command writes to that was given no -o: beside `source`, named like it with "-`kind`".
[[nodiscard]] std::filesystem::path output_beside(const std::filesystem::path& source, const std::string& kind);
/// `given`, or else `fallback`, which the user is told of.
[[nodiscard]] std::filesystem::path chosen_output(const std::filesystem::path& given,
                                                  const std::filesystem::path& fallback, Reporter& reporter);

/// Refuses `output` that exists unless `overwrite`.  @throws UsageError.
void refuse_existing(const std::filesystem::path& output, bool overwrite);

}  // namespace cnerf::app
