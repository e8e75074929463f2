#pragma once
/// Options of exports: what the files of a bake are told beside the bake itself.

#include <string>

#include "bake/provenance.h"
#include "src/base/options.h"

namespace cnerf::exporting {

/// What the numbers of the poses' frame mean to people and programs outside.
struct WorldConvention {
  std::string units = "scene units";
  std::string up_axis = "z";
  double metres_per_unit = 1;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("metres_per_unit", metres_per_unit, Range{1e-9, 1e9},
      "metres in a unit of the poses' frame: for glTF, USD and Blender");
    v("units", units, "what a world unit is called, for the metadata");
    v("up_axis", up_axis, Choice{"x", "y", "z"}, "axis that points up in the poses' frame");
  }
};

/// What every file of a bake says about itself.
struct Label {
  bake::Provenance provenance;
  WorldConvention world;
};

struct VdbOptions {
  std::string voxel_origin = "center";
  std::string compression = "blosc";
  bool houdini = false;
  bool nvdb = false;
  bool usd = false;
  bool plates = true;
  std::string up = "poses";

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("voxel_origin", voxel_origin, Choice{"center", "corner"},
      "where a voxel's value sits: center as OpenVDB says, corner as Blender up to 4.4 draws it");
    v("compression", compression, Choice{"blosc", "zip", "none"}, "of the VDB; zip for readers without blosc");
    v("houdini", houdini, "also write the colour grid under Houdini's name, Cd");
    v("nvdb", nvdb, "also the same grids as NanoVDB, .nvdb");
    v("usd", usd, "also a .usda with an OpenVDBAsset for each grid");
    v("plates", plates, "also the photographs without lens distortion, behind Blender's cameras");
    v("up", up, Choice{"poses", "y", "z"}, "axis that points up in the VDB: y for Houdini; poses turns nothing");
  }
};

struct WebOptions {
  int resolution = 256;
  int photo_side = 640;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("resolution", resolution, Range{16, 1024},
      "voxels along the longest axis of each nested grid, at most those of the bake");
    v("photo_side", photo_side, Range{0, 8192}, "pixels of a photograph's long side; 0 leaves them out");
  }
};

}  // namespace cnerf::exporting
