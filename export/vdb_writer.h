#pragma once
/// Baked voxels -> OpenVDB, as Blender and Houdini read it.

#include <filesystem>
#include <string>

#include "bake/baked_volume.h"
#include "src/base/options.h"

namespace cnerf {

struct VdbOptions {
  std::string voxel_origin = "center";  ///< where the file puts a voxel's value: its centre (OpenVDB's rule) or corner
  std::string compression = "blosc";    ///< of the file; zip for readers built without blosc
  bool half = true;                     ///< 16-bit values where their range allows it
  bool houdini = false;                 ///< also write colour under Houdini's name, Cd
  int dilation = 2;                     ///< voxels that colour must reach beyond density; missing ones are added
  int padding = 1;                      ///< layers of zero density beyond that
  std::string units = "scene units";    ///< what a world unit is; recorded only
  std::string up_axis = "z";            ///< recorded only: nothing is rotated, Blender shows the file as it is

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("voxel_origin", voxel_origin, Choice{"center", "corner"},
      "where a voxel's value sits: center as OpenVDB says, corner as Blender up to 4.4 draws it");
    v("compression", compression, Choice{"blosc", "zip", "none"}, "of the VDB; zip for readers without blosc");
    v("half", half, "16-bit values");
    v("houdini", houdini, "also write the colour grid as Cd");
    v("dilation", dilation, Range{2, 6}, "voxels that colour reaches beyond density");
    v("padding", padding, Range{1, 2}, "layers of zero density around it");
    v("units", units, "what a world unit is, for the metadata");
    v("up_axis", up_axis, Choice{"x", "y", "z"}, "axis that points up in the poses' frame, for the metadata");
  }
};

/// Writes `density` (1/world unit), `color` (linear Rec.709), `lab_a`, `lab_b`, `luminance` (linear Y) and, if asked
/// for, `Cd`. All share one transform, voxel ijk of the file being voxel ijk of the volume, and one set of active
/// voxels that reaches `dilation + padding` beyond density. World is the frame of the poses.
/// Density is stored in 16 bits only when all of it is within their normal range; else that grid has 32.
/// The file is whole or not there.
/// @throws ContractError  on NaN, infinity, negative density, an empty volume or an unknown option value.
/// @throws OutputError    when the file cannot be written.
void write_vdb(const BakedVolume& volume, const std::filesystem::path& path, const VdbOptions& options = {});

/// Whether `density` of this volume is stored in 16 bits.
[[nodiscard]] bool density_fits_half(const BakedVolume& volume);

}  // namespace cnerf
