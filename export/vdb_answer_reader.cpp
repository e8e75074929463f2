#include "export/vdb_answer_reader.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "bake/out_of_core/planes.h"
#include "export/vdb_answer.h"
#include "src/base/error.h"
#include "src/base/json.h"
#include "src/base/json_record.h"

namespace cnerf::exporting {
namespace {
namespace fs = std::filesystem;

constexpr std::size_t kPiece = std::size_t(1) << 24;  ///< bytes; no memory is taken for what only a header states

template <typename T>
T value_of(VdbAnswerSource& source) {
  T value;
  source.read(std::as_writable_bytes(std::span(&value, 1)));
  return value;
}

/// Values behind a header, `count` of them.
template <typename List>
List list_of(VdbAnswerSource& source, std::uint64_t count) {
  constexpr std::uint64_t kMost = kPiece / sizeof(typename List::value_type);
  List list;
  while (list.size() < count) {
    const std::size_t before = list.size();
    list.resize(std::size_t(std::min(count, before + kMost)));
    source.read(std::as_writable_bytes(std::span(list).subspan(before)));
  }
  return list;
}

std::string text_of(VdbAnswerSource& source, std::uint64_t bytes) {
  if (bytes > kLongestText) source.fail("answered too much");
  return list_of<std::string>(source, bytes);
}

/// The size of the answer.  @throws Error  what it says, where that is an error
std::uint64_t begin(VdbAnswerSource& source) {
  const auto header = value_of<VdbAnswerHeader>(source);
  if (header.version != VdbAnswerHeader{}.version) source.fail("answered in another version's words");
  if (header.status == 0) return header.bytes;
  const std::string message = text_of(source, header.bytes);
  if (header.status == int(ExitCode::kMissingInput)) throw MissingInputError(message);
  throw InputError(message);
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

}  // namespace

void VdbAnswerSource::fail(const std::string& what) const {
  throw InputError(file_.string() + ": damaged, or made to do harm: the program that reads it " + what);
}

bake::Volume volume_of_answer(VdbAnswerSource& source) {
  const std::uint64_t bytes = begin(source);
  if (bytes < sizeof(VdbVolumeHeader) || (bytes - sizeof(VdbVolumeHeader)) % sizeof(bake::Voxel) != 0 ||
      bytes / sizeof(bake::Voxel) > kMostVoxels) {
    source.fail("answered something else");
  }
  bake::Volume volume;
  static_cast<VdbVolumeHeader&>(volume) = value_of<VdbVolumeHeader>(source);
  volume.voxels = list_of<std::vector<bake::Voxel>>(source, (bytes - sizeof(VdbVolumeHeader)) / sizeof(bake::Voxel));
  check_volume(source.file(), volume);
  return volume;
}

VdbSummary summary_of_answer(VdbAnswerSource& source) {
  const std::string text = text_of(source, begin(source));
  return record_of<VdbSummary>(parse_json(text, source.file()), source.file());
}

}  // namespace cnerf::exporting
