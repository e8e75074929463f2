#include "export/vdb_reader.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <tuple>

#include "bake/out_of_core/planes.h"
#include "export/manifest.h"
#include "export/vdb_answer.h"
#include "export/vdb_limits.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json.h"
#include "src/base/json_record.h"
#include "src/base/plugin.h"
#include "src/base/process.h"
#include "src/base/progress.h"

namespace cnerf::exporting {
namespace {
namespace fs = std::filesystem;

/// The program that reads a file (vdb_reader_main.cpp), at the other end of a pipe.
class Reader {
 public:
  Reader(const char* what, const fs::path& file)
      : file_(file),
        cpu_(limits_of(false, file).cpu),
        process_("exec " + shell_word(program_part("cnerf-vdb-reader").string()) + " " + what + " " +
                 shell_word(file.string()) + " 2>/dev/null"),
        deadline_(std::chrono::steady_clock::now() + 6 * cpu_) {}

  /// The size of the answer.  @throws Error  what it says, where that is an error
  std::uint64_t begin() {
    VdbAnswerHeader header;
    read(std::as_writable_bytes(std::span(&header, 1)));
    if (header.version != VdbAnswerHeader{}.version) fail("answered in another version's words");
    if (header.status == 0) return header.bytes;
    const std::string message = text(header.bytes);
    if (header.status == int(ExitCode::kMissingInput)) throw MissingInputError(message);
    throw InputError(message);
  }
  void read(std::span<std::byte> bytes) {
    constexpr std::size_t kPiece = std::size_t(1) << 24;
    while (!bytes.empty()) {
      if (interruption_requested()) throw Interrupted("stopped");
      const std::span<std::byte> piece = bytes.first(std::min(kPiece, bytes.size()));
      const PipeTrouble trouble = process_.read_all(piece, deadline_);
      if (trouble == PipeTrouble::kTimedOut) fail_in_time();
      if (trouble == PipeTrouble::kEnded) {
        if (process_.process().exit_status(std::chrono::seconds(1)) == 128 + SIGXCPU) fail_in_time();
        fail(process_.process().fate());
      }
      bytes = bytes.subspan(piece.size());
    }
  }
  std::string text(std::uint64_t bytes) {
    if (bytes > kLongestText) fail("answered too much");
    std::string said(bytes, ' ');
    read(std::as_writable_bytes(std::span(said)));
    return said;
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_.string() + ": damaged, or made to do harm: the program that reads it " + what);
  }

 private:
  [[noreturn]] void fail_in_time() const { fail("took longer than " + std::to_string(cpu_.count()) + " s"); }

  fs::path file_;
  std::chrono::seconds cpu_;
  PipedProcess process_;
  PipedProcess::Deadline deadline_;
};

void check_exists(const fs::path& path) {
  std::error_code failure;
  if (!fs::exists(path, failure)) throw MissingInputError(path.string() + ": no such file");
  if (!fs::is_regular_file(path, failure)) throw InputError(path.string() + ": is no file");
}

bool is_finite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Which grid holds the value for which a voxel is not valid.
const char* wrong_grid(const bake::Voxel& v) {
  if (!std::isfinite(v.sigma) || v.sigma < 0) return "density";
  if (!std::isfinite(v.luminance)) return "luminance";
  return std::isfinite(v.a) && std::isfinite(v.b) ? "color" : "lab_a, lab_b";
}

/// @throws InputError  where a volume cannot be rendered, whatever the reader says
void check_volume(const fs::path& path, const bake::Volume& volume) {
  if (!(volume.voxel_size > 0) || !std::isfinite(volume.voxel_size) || !is_finite(volume.origin) ||
      !is_finite(volume.frame.world_centre) || !std::isfinite(volume.frame.unit_per_world)) {
    throw InputError(path, "transform", "expected finite numbers and voxels that are larger than nothing");
  }
  if (volume.voxels.empty()) throw InputError(path, "density", "holds no voxels");
  Vec3i low{volume.voxels[0].i, volume.voxels[0].j, volume.voxels[0].k}, high = low;
  const bake::Voxel* before = nullptr;
  for (const bake::Voxel& v : volume.voxels) {
    const Vec3i at{v.i, v.j, v.k};
    if (!is_valid(v)) {
      throw InputError(path, wrong_grid(v),
                       "expected finite values, and no negative density, found another at voxel " +
                           std::to_string(v.i) + ", " + std::to_string(v.j) + ", " + std::to_string(v.k));
    }
    if (before != nullptr && std::tie(before->i, before->j, before->k) >= std::tie(v.i, v.j, v.k)) {
      throw InputError(path, "density", "its voxels are out of order");
    }
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], at[axis]);
      high[axis] = std::max(high[axis], at[axis]);
    }
    before = &v;
  }
  if (!is_legal_box(low, high)) throw InputError(path, "density", "its voxels lie too far apart");
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
  const std::uint64_t bytes = reader.begin();
  if (bytes < sizeof(VdbVolumeHeader) || (bytes - sizeof(VdbVolumeHeader)) % sizeof(bake::Voxel) != 0 ||
      bytes / sizeof(bake::Voxel) > kMostVoxels) {
    reader.fail("answered something else");
  }
  bake::Volume volume;
  VdbVolumeHeader header;
  reader.read(std::as_writable_bytes(std::span(&header, 1)));
  static_cast<VdbVolumeHeader&>(volume) = header;
  volume.voxels.resize((bytes - sizeof header) / sizeof(bake::Voxel));
  reader.read(std::as_writable_bytes(std::span(volume.voxels)));
  check_volume(path, volume);
  return volume;
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
  const std::string text = reader.text(reader.begin());
  return record_of<VdbSummary>(parse_json(text, path), path);
}

}  // namespace cnerf::exporting
