#pragma once
/// Cuts a surface into charts: patches flat enough to be laid into a plane without overlapping themselves.

#include <cstdint>
#include <vector>

#include "bake/mesh/surface/surface_mesh.h"
#include "bake/mesh/uv/planar_triangles.h"

namespace cnerf::bake {

struct ChartOptions {
  float grow_degrees = 60;   ///< a chart grows over faces whose normal is within this of its own
  float merge_degrees = 80;  ///< a chart that fits into a neighbour within this is merged: fewer seams, more stretch
};

/// A plane with right-handed axes: u x v is the chart's normal.
struct ChartPlane {
  Vec3f u, v;
  [[nodiscard]] Point2 project(Vec3f p) const { return {dot(u, p), dot(v, p)}; }
  [[nodiscard]] Vec3f normal() const { return cross(u, v); }
};

struct UvChart {
  std::vector<std::uint32_t> faces;  ///< of the mesh
  ChartPlane plane;
};

/// Charts that together have every face of non-zero area exactly once. Within a chart no two projected faces overlap
/// and none is turned over. Same result in every call.
[[nodiscard]] std::vector<UvChart> make_charts(const SurfaceMesh& mesh, const ChartOptions& options = {});

}  // namespace cnerf::bake
