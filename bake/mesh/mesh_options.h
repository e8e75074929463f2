#pragma once
/// Options of the mesh bake.

#include "src/base/options.h"

namespace cnerf {

struct MeshOptions {
  int faces = 60000;            ///< triangles after decimation, about
  double surface_depth = 2.0;   ///< voxels of matter that halve the light where the surface is drawn
  double adaptivity = 0.02;     ///< of the extraction: how far flat parts may be merged; 0 = one quad a voxel
  double smallest_part = 0.03;  ///< diagonal of a loose part, in diagonals of the whole, below which it is dropped
  int smoothing = 4;            ///< rounds of smoothing that keeps the volume, against voxel steps
  int texture_size = 2048;      ///< texels along a side
  int gutter = 2;               ///< texels around a chart that belong to no other
  int views_per_texel = 6;      ///< training views that a texel is averaged over, at most
  double ray_outside = 2.0;     ///< voxels outside the surface where a texel's ray starts
  double ray_inside = 4.0;      ///< voxels inside the surface where it ends

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("faces", faces, Range{16, 1e8}, "triangles of the mesh, about");
    v("surface_depth", surface_depth, Range{0.05, 64}, "voxels of matter that halve the light at the surface");
    v("adaptivity", adaptivity, Range{0, 1}, "how far flat parts are merged when the surface is extracted");
    v("smallest_part", smallest_part, Range{0, 1}, "loose parts smaller than this share of the whole are dropped");
    v("smoothing", smoothing, Range{0, 100}, "rounds of smoothing that keeps the volume");
    v("texture_size", texture_size, Range{64, 16384}, "texels along a side of the textures");
    v("gutter", gutter, Range{1, 32}, "texels around a chart that belong to no other");
    v("views_per_texel", views_per_texel, Range{1, 256}, "views that a texel is averaged over");
    v("ray_outside", ray_outside, Range{0, 64}, "voxels outside the surface where a texel's ray starts");
    v("ray_inside", ray_inside, Range{0.25, 64}, "voxels inside the surface where a texel's ray ends");
  }
};

}  // namespace cnerf
