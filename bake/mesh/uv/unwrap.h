#pragma once
/// A surface with texture coordinates.

#include <vector>

#include "bake/mesh/surface/surface_mesh.h"
#include "bake/mesh/uv/uv_charts.h"

namespace cnerf::bake {

/// Vertices on seams exist once for every chart they belong to.
struct UnwrappedMesh {
  SurfaceMesh mesh;
  std::vector<Vec3f> normals;        ///< [positions]; continuous across seams
  std::vector<Point2> texels;        ///< [positions]; texel (0, 0) is the upper left one, its centre at (0.5, 0.5)
  std::vector<std::uint32_t> chart;  ///< [triangles]
  int charts = 0;
  int size = 0;  ///< texels along a side

  [[nodiscard]] PlanarTriangle texture_triangle(std::size_t triangle) const {
    const Triangle& t = mesh.triangles[triangle];
    return {texels[t[0]], texels[t[1]], texels[t[2]]};
  }
};

/// Charts and packing in one. Triangles without area are left out.
/// @throws UsageError  when the charts do not go into a texture of this size, see pack_charts.
[[nodiscard]] UnwrappedMesh unwrap(const SurfaceMesh& mesh, int size, int gutter);

}  // namespace cnerf::bake
