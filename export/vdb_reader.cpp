#include "export/vdb_reader.h"

#include <csignal>

#include "export/manifest.h"
#include "export/vdb_answer_reader.h"
#include "export/vdb_limits.h"
#include "src/base/error.h"
#include "src/base/plugin.h"
#include "src/base/process.h"
#include "src/base/progress.h"

namespace cnerf::exporting {
namespace {
namespace fs = std::filesystem;

/// What the program that reads a file (vdb_reader_main.cpp) says, at the other end of a pipe.
class Reader final : public VdbAnswerSource {
 public:
  Reader(const char* what, const fs::path& file)
      : VdbAnswerSource(file),
        cpu_(limits_of(false, file).cpu),
        process_("exec " + shell_word(program_part("cnerf-vdb-reader").string()) + " " + what + " " +
                 shell_word(file.string()) + " 2>/dev/null"),
        deadline_(std::chrono::steady_clock::now() + 6 * cpu_) {}

  void read(std::span<std::byte> bytes) override {
    if (interruption_requested()) throw Interrupted("stopped");
    const PipeTrouble trouble = process_.read_all(bytes, deadline_);
    if (trouble == PipeTrouble::kTimedOut) fail_in_time();
    if (trouble == PipeTrouble::kEnded) {
      if (process_.process().exit_status(std::chrono::seconds(1)) == 128 + SIGXCPU) fail_in_time();
      fail(process_.process().fate());
    }
  }

 private:
  [[noreturn]] void fail_in_time() const { fail("took longer than " + std::to_string(cpu_.count()) + " s"); }

  std::chrono::seconds cpu_;
  PipedProcess process_;
  PipedProcess::Deadline deadline_;
};

void check_exists(const fs::path& path) {
  std::error_code failure;
  if (!fs::exists(path, failure)) throw MissingInputError(path.string() + ": no such file");
  if (!fs::is_regular_file(path, failure)) throw InputError(path.string() + ": is no file");
}

/// Reads a file of a bake if it is the one that the manifest lists.
bake::Volume read_listed(const fs::path& folder, const BakeManifest& manifest, const std::string& name) {
  check_listed_file(manifest, folder, name);
  return read_vdb(folder / name);
}

}  // namespace

bake::Volume read_vdb(const fs::path& path) {
  check_exists(path);
  Reader reader("volume", path);
  return volume_of_answer(reader);
}

std::vector<bake::Volume> read_volumes(const fs::path& bake_folder) {
  const BakeManifest manifest = read_manifest(bake_folder / "manifest.json");
  if (!manifest.volume) {
    throw InputError(bake_folder / "manifest.json", "volume", "this bake has none; bake with --format vdb");
  }
  std::vector<bake::Volume> volumes;
  for (const ManifestVolume& finer : manifest.finer_volumes) {
    volumes.push_back(read_listed(bake_folder, manifest, finer.file));
  }
  volumes.push_back(read_listed(bake_folder, manifest, manifest.volume->file));
  return volumes;
}

VdbSummary summarize_vdb(const fs::path& path) {
  check_exists(path);
  Reader reader("summary", path);
  return summary_of_answer(reader);
}

}  // namespace cnerf::exporting
