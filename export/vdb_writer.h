#pragma once
/// Baked voxels -> OpenVDB, as Blender and Houdini read it.

#include <filesystem>
#include <string>

#include "bake/bake_options.h"
#include "bake/volume_planes.h"
#include "src/base/options.h"
#include "src/base/vec3.h"

namespace cnerf {

struct VdbOptions {
  std::string voxel_origin = "center";  ///< where the file puts a voxel's value: its centre (OpenVDB's rule) or corner
  std::string compression = "blosc";    ///< of the file; zip for readers built without blosc
  bool half = true;                     ///< 16-bit values where their range allows it
  bool houdini = false;                 ///< also write colour under Houdini's name, Cd
  bool emission = false;                ///< also density times color, which interpolates exactly
  bool normalize_density = false;       ///< density divided by its largest value, which the metadata keeps
  bool nvdb = false;                    ///< also the same grids as NanoVDB
  bool usd = false;                     ///< also a .usda that places the grids, for programs that read USD
  bool plates = true;                   ///< also the photographs without lens distortion, for Blender's cameras
  double metres_per_unit = 1;           ///< of the world; for the manifest and USD
  int padding = 1;                      ///< voxels of zeros between that and the sides of the active box
  std::string units = "scene units";    ///< what a world unit is; recorded only
  std::string up_axis = "z";            ///< axis that points up in the poses' frame
  std::string up = "poses";             ///< axis that points up in the file; "poses": nothing is turned

  /// Voxels that colour must reach beyond density; missing ones are added. Not an option by itself: the bake's.
  int dilation = BakeOptions{}.dilation;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("voxel_origin", voxel_origin, Choice{"center", "corner"},
      "where a voxel's value sits: center as OpenVDB says, corner as Blender up to 4.4 draws it");
    v("compression", compression, Choice{"blosc", "zip", "none"}, "of the VDB; zip for readers without blosc");
    v("half", half, "16-bit values");
    v("houdini", houdini, "also write the colour grid as Cd");
    v("emission", emission, "also write a grid emission: density times color");
    v("normalize_density", normalize_density, "density from 0 to 1, its largest value in the metadata");
    v("nvdb", nvdb, "also the same grids as NanoVDB, .nvdb");
    v("usd", usd, "also a .usda with an OpenVDBAsset for each grid");
    v("plates", plates, "also the photographs without lens distortion, behind Blender's cameras");
    v("metres_per_unit", metres_per_unit, Range{1e-9, 1e9}, "metres in a unit of the poses' frame");
    v("padding", padding, Range{1, 2}, "voxels of zeros between that and the sides of the grids' box");
    v("units", units, "what a world unit is, for the metadata");
    v("up_axis", up_axis, Choice{"x", "y", "z"}, "axis that points up in the poses' frame");
    v("up", up, Choice{"poses", "y", "z"}, "axis that points up in the VDB: y for Houdini; poses turns nothing");
  }
};

/// The world of a file from the poses' frame: a rotation that takes `up_axis` to `up`; the identity for "poses".
[[nodiscard]] Affined file_from_world(const VdbOptions& options);

/// Writes `density` (1/world unit; with `normalize_density` in units of the metadata's `cnerf_density_scale`), `color`
/// (linear Rec.709), `lab_a`, `lab_b`, `luminance` (linear Y) and, if asked for, `Cd` and `emission`. All share one
/// transform, voxel ijk of the file being voxel ijk of the volume, and one set of active voxels: those that reach
/// `dilation` beyond density, and two corners that keep the box of all of them `padding` voxels away, because renderers
/// that make grids dense fade density, but not colour, at the sides of that box. World is the frame of the poses,
/// turned by `up`; the metadata's `cnerf_world_to_source` turns it back. Density is stored in 16 bits only when all of
/// it is within their normal range; else that grid has 32. All grids are made and compressed at the same time; where
/// the volume is sparing one after another, so that the largest, not their sum, is what this holds. The file is whole
/// or not there.
/// @throws ContractError  on NaN, infinity, negative density, an empty volume or an unknown option value.
/// @throws OutputError    when the file cannot be written.
void write_vdb(const VolumePlanes& volume, const std::filesystem::path& path, const VdbOptions& options = {});
void write_vdb(const BakedVolume& volume, const std::filesystem::path& path, const VdbOptions& options = {});

/// Whether `density` of this volume is stored in 16 bits.
[[nodiscard]] bool density_fits_half(const VolumeStatistics& volume, const VdbOptions& options);

/// What `density` of the file has to be multiplied with, 1/world unit; 1 unless `normalize_density`.
[[nodiscard]] double density_scale(const VolumeStatistics& volume, const VdbOptions& options);

}  // namespace cnerf
