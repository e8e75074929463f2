#pragma once
/// OpenVDB -> baked voxels, and what a file holds. Files are read by a program of their own with limits on memory and
/// time (cnerf-vdb-reader), since OpenVDB does not stand damaged ones.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "bake/volume.h"
#include "export/vec3_json.h"
#include "src/base/aabb.h"

namespace cnerf::exporting {

/// The active voxels of a file with a `density` grid; `color`, `lab_a`, `lab_b` and `luminance` are 0 where missing.
/// Files that do not say where their values sit are taken as centred.
/// @throws MissingInputError, InputError  e.g. without `density` or voxels in it, with values that are none, with a
///                                        transform that is not uniform or turned, or larger than vdb_answer.h allows.
[[nodiscard]] bake::Volume read_vdb(const std::filesystem::path& path);

/// The grids of a bake by its manifest, finest first; each file only if it has the size and the SHA-256 of the
/// manifest.
/// @throws MissingInputError, InputError  also when the bake has no volume.
[[nodiscard]] std::vector<bake::Volume> read_volumes(const std::filesystem::path& bake_folder);

struct VdbGridSummary {
  std::string name, type, grid_class;  ///< "density", "float", "fog volume"
  bool half = false;                   ///< stored in 16 bits
  std::uint64_t active_voxels = 0;
  Vec3i index_min{}, index_max{};            ///< of active voxels, both inclusive
  Vec3d voxel_size{};                        ///< world units
  Aabbd world_box{};                         ///< positions of the first and last value
  std::vector<double> min_value, max_value;  ///< of active voxels, by component; empty for other types, and where the
                                             ///< grid is too large to look at all of them
  std::uint64_t not_finite = 0;              ///< how many values are NaN or infinite; they are left out
  std::map<std::string, std::string> metadata;

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("name", self.name);
    v("type", self.type);
    v("grid_class", self.grid_class);
    v("half", self.half);
    v("active_voxels", self.active_voxels);
    v("index_min", self.index_min);
    v("index_max", self.index_max);
    v("voxel_size", self.voxel_size);
    v("world_box", self.world_box);
    v("min_value", self.min_value);
    v("max_value", self.max_value);
    v("not_finite", self.not_finite);
    v("metadata", self.metadata);
  }
};

struct VdbSummary {
  std::map<std::string, std::string> metadata;  ///< of the file
  std::vector<VdbGridSummary> grids;            ///< in the order of the file

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("metadata", self.metadata);
    v("grids", self.grids);
  }
};

/// @throws MissingInputError, InputError.
[[nodiscard]] VdbSummary summarize_vdb(const std::filesystem::path& path);

}  // namespace cnerf::exporting
