#include "src/pipeline/run_context.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "src/base/byte_count.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/text.h"
#include "src/base/usage.h"
#include "src/capture/load_capture.h"
#include "src/cluster/ranks.h"
#include "src/pipeline/version.h"
#include "src/train/luminance/learned_views.h"
#include "src/train/luminance/stage1.h"

namespace cnerf::pipeline {
namespace fs = std::filesystem;

/// Folders between one that a step holds and the files it writes: renders/NAME/PATH, bakes/NAME/web/LEVEL.
constexpr int kDeepestOutput = 3;

FolderLock lock_folder(const fs::path& folder, FolderLock::Mode mode, Observer& observer) {
  if (!cluster::world().is_first()) return FolderLock::of_another_process();
  FolderLock lock(folder, mode);
  if (!lock.is_held()) {
    observer.say("note: " + folder.string() +
                 ": this file system has no locks; take care that no other cnerf writes there");
  }
  remove_leftovers(folder, kDeepestOutput);
  return lock;
}

StepLocks::StepLocks(const RunDirectory& directory, const fs::path& folder, Observer& observer)
    : run(lock_folder(directory.root(), FolderLock::Mode::kShared, observer)) {
  std::error_code failure;  // where one of them is missing, they are two
  const bool is_run = fs::equivalent(folder, directory.root(), failure);
  if (!is_run) own = lock_folder(folder, FolderLock::Mode::kAlone, observer);
  cluster::world().barrier("begin of a step");
}

std::size_t image_memory(const Config& config) {
  if (!config.image_memory.empty()) return bytes_from("image_memory", config.image_memory);
  const auto all = std::size_t(::sysconf(_SC_PHYS_PAGES)) * std::size_t(::sysconf(_SC_PAGESIZE));
  return all / 4 / std::size_t(cluster::world().local_size());
}

namespace {

/// The folder itself, or the one that it will be made in; empty where there is none of them.
fs::path nearest_folder(fs::path folder) {
  std::error_code failure;  // what cannot be looked at is refused where it is written
  if (!folder.empty()) folder = fs::absolute(folder, failure);
  while (!folder.empty() && !fs::is_directory(folder, failure)) folder = folder.parent_path();
  return folder;
}

void say_size(const Capture& capture, std::size_t memory, double seconds, Observer& observer) {
  std::size_t bytes = 0;
  for (const View& view : capture.views) bytes += bytes_of(view.image);
  constexpr std::size_t kWorthSaying = std::size_t(1) << 30;
  if (bytes <= std::min(memory, kWorthSaying)) return;
  const std::string place =
      bytes > memory ? "in a file, at most " + in_words(memory) + " of them in memory" : "in memory";
  observer.say(fmt::format("photographs: {} of pixels, {}; read in {}, {} resident", in_words(bytes), place,
                           duration_text(seconds), in_words(held_memory_bytes())));
}

}  // namespace

Capture read_capture(const fs::path& path, const Config& config, Observer& observer, const fs::path& output) {
  const std::size_t memory = image_memory(config);
  const Stopwatch watch;
  Capture capture = load_capture(path, config.capture, {memory, nearest_folder(output)});
  const auto held_out = std::ranges::count_if(capture.views, [](const View& view) { return view.held_out; });
  const Intrinsics& first = capture.views.front().intrinsics;
  observer.say(fmt::format("capture: {} ({}, {} views of {} x {}, {} held out)", path.string(), capture.format,
                           capture.views.size(), first.width, first.height, held_out));
  for (const std::string& note : capture.notes) observer.say("note: " + note);
  say_size(capture, memory, watch.seconds(), observer);
  return capture;
}

void use_learned_views(RunContext& context, Observer& observer) {
  for (const std::string& line : apply_learned_views(context.capture, context.directory.stage1_snapshot())) {
    observer.say(line);
  }
}

void check_choice(const ExistingOutput& existing) {
  if (!existing.resume || !existing.overwrite) return;
  throw UsageError("--resume goes on with what is there, --overwrite replaces it: give one of them");
}

void check_run_folder(const RunDirectory& directory, const ExistingOutput& existing) {
  check_choice(existing);
  const fs::path& root = directory.root();
  if (directory.exists()) {
    if (existing.resume || existing.overwrite) return;
    throw UsageError(root.string() +
                     ": holds a run already; pass --resume to go on with it or --overwrite to start again");
  }
  if (!is_vacant(root, {directory.config_file().filename(), directory.colorizer_cache().filename()})) {
    throw UsageError(root.string() + ": is not empty and holds no run; choose another folder");
  }
}

FolderLock claim_run_folder(const RunDirectory& directory, const ExistingOutput& existing, Observer& observer) {
  check_run_folder(directory, existing);
  cluster::world().barrier("look at the run's folder");  // before rank 0 changes it
  FolderLock lock = lock_folder(directory.root(), FolderLock::Mode::kAlone, observer);
  if (cluster::world().is_first()) check_run_folder(directory, existing);  // again, now that nobody can change it
  return lock;
}

namespace {

void begin_records(const RunContext& context, const fs::path& capture_path, const ExistingOutput& existing) {
  const RunDirectory& directory = context.directory;
  const FolderLock lock(directory.root());
  const bool goes_on = directory.exists() && existing.resume;
  if (directory.exists() && !goes_on) directory.clear();
  // Before the configuration is written: what is refused must not take the place of what the run was made with.
  if (goes_on) {
    check_continues(directory.stage1_snapshot(), context.config.stage1);
    check_views(directory.stage1_snapshot(), context.capture);
  }
  write_file(directory.config_file(), to_toml(context.config));
  if (goes_on) return;
  RunRecord record;
  record.capture = fs::absolute(capture_path).lexically_normal();
  record.program_version = version_text();
  record.command_line = joined(context.command_line);
  directory.save(record);
}

}  // namespace

void begin_run(const RunContext& context, const fs::path& capture_path, const ExistingOutput& existing) {
  if (cluster::world().is_first()) begin_records(context, capture_path, existing);
  cluster::world().barrier("begin of the run");
}

}  // namespace cnerf::pipeline
