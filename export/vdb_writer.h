#pragma once
/// Baked voxels -> OpenVDB, as Blender and Houdini read it, and NanoVDB, as renderers on graphics cards do.

#include <filesystem>
#include <string>

#include "bake/out_of_core/planes.h"
#include "export/options.h"
#include "src/base/vec3.h"

namespace cnerf::exporting {

/// The world of a file from the poses' frame: a rotation that takes its up axis to `options.up`; the identity for
/// "poses".
[[nodiscard]] Affined file_from_world(const VdbOptions& options, const WorldConvention& world);
/// The axis that points up in a file.
[[nodiscard]] std::string up_axis_of_file(const VdbOptions& options, const WorldConvention& world);

/// Writes `density` (1/world unit), `color` (linear Rec.709), `lab_a`, `lab_b`, `luminance` (linear Y) and, if asked
/// for, `Cd`. All share one transform, voxel ijk of the file being voxel ijk of the volume, and one set of active
/// voxels: those of the volume (colours should reach beyond density, see bake::dilated), and two corners that keep the
/// box of all of them a voxel away, because renderers that make grids dense fade density, but not colour, at the sides
/// of that box. World is the frame of the poses, turned by `up`; the metadata's `cnerf_world_to_source` turns it back.
/// Density is stored in 16 bits only when all of it is within their normal range; else that grid has 32. All grids are
/// made and compressed at the same time; where the volume is sparing one after another, so that the largest, not their
/// sum, is what this holds. The file is whole or not there.
/// @throws ContractError  on an empty volume or an unknown option value.
/// @throws OutputError    when the file cannot be written.
void write_vdb(const bake::VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options = {},
               const Label& label = {});

/// The same grids, with the same names, transform and active voxels, as NanoVDB: in 32 bits and not compressed, which
/// every reader of it knows. The format has no place for text, so the manifest alone says where the colours come from.
/// The file is whole or not there.
/// @throws ContractError, OutputError  as write_vdb.
void write_nvdb(const bake::VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options = {},
                const Label& label = {});

/// Whether `density` of this volume is stored in 16 bits.
[[nodiscard]] bool density_fits_half(const bake::VolumeStatistics& volume);

}  // namespace cnerf::exporting
