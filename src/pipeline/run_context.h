#pragma once
/// What the steps of a run work on, and the start of a run. Each step is usable alone: `cnerf run` does one after
/// another, the other commands do one each.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "src/base/folder_lock.h"
#include "src/base/observer.h"
#include "src/capture/capture.h"
#include "src/config/config.h"
#include "src/pipeline/run_directory.h"

namespace cnerf::pipeline {

struct RunContext {
  RunDirectory directory;
  Config config;
  Capture capture;
  std::vector<std::string> command_line;  ///< for records
};

/// What to do about output that is already there.
struct ExistingOutput {
  bool resume = false;     ///< go on where it stopped; what is finished stays
  bool overwrite = false;  ///< start again
};
/// @throws UsageError  where both are set
void check_choice(const ExistingOutput& existing);

/// Puts what a finished stage 1 learned of its views into the context's capture, and says it. Not for going on with
/// stage 1, which learns from the capture as it is.  @throws SnapshotError
void use_learned_views(RunContext& context, Observer& observer);

/// Bytes that photographs may take of the processor's memory, and again of a GPU's; of several ranks, each. Where the
/// user does not say, the ranks of a machine share a quarter of its memory.
[[nodiscard]] std::size_t image_memory(const Config& config);
/// Reads a capture and says what was found, with the reader's notes, and where large photographs lie.
/// @param output  the folder that is worked in; what of the photographs does not fit into memory lies on its disk
[[nodiscard]] Capture read_capture(const std::filesystem::path& path, const Config& config, Observer& observer,
                                   const std::filesystem::path& output = {});

/// FolderLock, which rank 0 holds for all; says so where the file system has no locks. Clears away what killed writers
/// left there.
[[nodiscard]] FolderLock lock_folder(const std::filesystem::path& folder, FolderLock::Mode mode, Observer& observer);
/// For a step that works on a run and writes a folder of its own, which may lie in the run: holds that one alone, and
/// keeps the run from being cleared. Ranks wait for each other here.
struct StepLocks {
  StepLocks(const RunDirectory& directory, const std::filesystem::path& folder, Observer& observer);
  FolderLock run;
  std::optional<FolderLock> own;  ///< none where it is the run's folder itself, of which single files are written
};

/// Whether a run may go to the folder; nothing is changed yet.
/// @throws UsageError  when there is a run and neither is set, when both are, or the folder holds something else.
void check_run_folder(const RunDirectory& directory, const ExistingOutput& existing);
/// Holds a folder that a run may go to.  @throws UsageError as check_run_folder, BusyError, OutputError
[[nodiscard]] FolderLock claim_run_folder(const RunDirectory& directory, const ExistingOutput& existing,
                                          Observer& observer);
/// Makes the folder of a run ready: clears it to overwrite, writes config.toml and run.json.
void begin_run(const RunContext& context, const std::filesystem::path& capture_path, const ExistingOutput& existing);

}  // namespace cnerf::pipeline
