#pragma once
/// Options of the mesh bake.

#include "src/base/options.h"

namespace cnerf::bake {

struct MeshOptions {
  int faces = 60000;
  double surface_depth = 2;
  double smallest_part = 0.03;
  int smoothing = 4;
  int texture_size = 2048;
  int gutter = 2;
  int views_per_texel = 6;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("faces", faces, Range{16, 1e8}, "triangles of the mesh, about");
    v("surface_depth", surface_depth, Range{0.05, 64}, "voxels of matter that halve the light at the surface");
    v("smallest_part", smallest_part, Range{0, 1},
      "diagonal of a loose part, in diagonals of the whole, below which it is dropped");
    v("smoothing", smoothing, Range{0, 100}, "rounds of smoothing that keeps the volume, against voxel steps");
    v("texture_size", texture_size, Range{64, 16384}, "texels along a side of the textures");
    v("gutter", gutter, Range{1, 32}, "texels around a chart that belong to no other");
    v("views_per_texel", views_per_texel, Range{1, 256}, "views that a texel is averaged over, at most");
  }
};

}  // namespace cnerf::bake
