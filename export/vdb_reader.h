#pragma once
/// OpenVDB -> baked voxels, and what a file holds.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "bake/volume.h"
#include "src/base/aabb.h"

namespace cnerf::exporting {

/// The active voxels of a file with a `density` grid; `color`, `lab_a`, `lab_b` and `luminance` are 0 where missing.
/// Files that do not say where their values sit are taken as centred.
/// @throws MissingInputError, InputError  e.g. without `density`, or with a transform that is not uniform or turned.
[[nodiscard]] bake::Volume read_vdb(const std::filesystem::path& path);

/// The grids of a bake by its manifest, finest first.
/// @throws MissingInputError, InputError  also when the bake has no volume.
[[nodiscard]] std::vector<bake::Volume> read_volumes(const std::filesystem::path& bake_folder);

struct VdbGridSummary {
  std::string name, type, grid_class;  ///< "density", "float", "fog volume"
  bool half = false;                   ///< stored in 16 bits
  std::uint64_t active_voxels = 0;
  Vec3i index_min{}, index_max{};            ///< of active voxels, both inclusive
  Vec3d voxel_size{};                        ///< world units
  Aabbd world_box{};                         ///< positions of the first and last value
  std::vector<double> min_value, max_value;  ///< of active voxels, by component; empty for other types
  std::map<std::string, std::string> metadata;
};

struct VdbSummary {
  std::map<std::string, std::string> metadata;  ///< of the file
  std::vector<VdbGridSummary> grids;            ///< in the order of the file
};

/// @throws MissingInputError, InputError.
[[nodiscard]] VdbSummary summarize_vdb(const std::filesystem::path& path);

}  // namespace cnerf::exporting
