#pragma once
/// Options of bakes.

#include <algorithm>
#include <cmath>
#include <string>

#include "src/base/options.h"

namespace cnerf::bake {

/// Density at which `length` of matter is just opaque enough to be kept, 1 over the length's unit.
/// @param opacity_threshold  of the options; what is nearly 1 counts as 0.999
[[nodiscard]] inline double faintest_density(double opacity_threshold, double length) {
  return -std::log1p(-std::min(opacity_threshold, 0.999)) / length;
}

struct Options {
  int resolution = 256;
  double voxel_size = 0;
  std::string aabb;
  double opacity_threshold = 0.01;
  double weight_threshold = 0.0125;
  std::string grids = "auto";
  std::string budget;
  std::string max_memory;
  int dilation = 2;
  double sharpening = 1;
  int subsamples = 2;
  int views_per_voxel = 8;
  bool keep_unseen = false;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("resolution", resolution, Range{16, 4096},
      "voxels along the longest axis, the margin of dilated colour included");
    v("voxel_size", voxel_size, Range{0, 1e9}, "world units; 0 takes it from the resolution");
    v("aabb", aabb, "box to bake, x0,y0,z0,x1,y1,z1 in world units; empty = around occupied space");
    v("opacity_threshold", opacity_threshold, Range{0, 1},
      "opacity 1 - exp(-sigma h) of a voxel below which it is dropped");
    v("weight_threshold", weight_threshold, Range{0, 0.5},
      "share of a pixel's light a voxel gives to the view that sees it best, below which it is dropped");
    v("grids", grids, Choice{"auto", "one", "nested"},
      "one grid, or nested ones, finer where most pixels look; auto nests where the field has cascades");
    v("budget", budget, "memory Cycles may take for the grids, as 4G or 500M; makes voxels larger until they fit");
    v("max_memory", max_memory,
      "memory the bake of a volume may take, as 1G; one that needs more is refused, or stopped before its files are "
      "written");
    v("dilation", dilation, Range{2, 8}, "voxels that colour reaches beyond density, into which renderers interpolate");
    v("sharpening", sharpening, Range{0, 4}, "of density at rims, which renderers widen by interpolation; 0 = none");
    v("subsamples", subsamples, Range{1, 8}, "density samples along each axis of a voxel");
    v("views_per_voxel", views_per_voxel, Range{1, 256}, "views that a voxel's luminance is averaged over, at most");
    v("keep_unseen", keep_unseen, "keep voxels that no camera sees, with luminance from six directions");
  }
};

struct MeshOptions {
  int faces = 60000;
  double surface_depth = 2;
  double smallest_part = 0.03;
  int smoothing = 4;
  int texture_size = 2048;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("faces", faces, Range{16, 1e8}, "triangles of the mesh, about");
    v("surface_depth", surface_depth, Range{0.05, 64}, "voxels of matter that halve the light at the surface");
    v("smallest_part", smallest_part, Range{0, 1},
      "diagonal of a loose part, in diagonals of the whole, below which it is dropped");
    v("smoothing", smoothing, Range{0, 100}, "rounds of smoothing that keeps the volume, against voxel steps");
    v("texture_size", texture_size, Range{64, 16384}, "texels along a side of the textures");
  }
};

}  // namespace cnerf::bake
