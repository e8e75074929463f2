#pragma once
/// Surfaces with known shape, in voxel coordinates.

#include <cmath>
#include <functional>
#include <map>
#include <utility>

#include "bake/lattice/brick_grid.h"
#include "bake/mesh/surface/isosurface.h"
#include "bake/mesh/surface/surface_mesh.h"

namespace cnerf::bake::test {

/// Voxels of side 1 whose light is `share(centre)` taken by something opaque; 0 means empty.
inline BrickGrid<float> covered_voxels(Vec3i size, const std::function<double(Vec3d)>& share) {
  constexpr double kOpaque = 20;  // what a bake clamps to
  BrickGrid<float> sigma({0, 0, 0}, size, 0.0f);
  for (int x = 2; x < size.x - 2; ++x)
    for (int y = 2; y < size.y - 2; ++y)
      for (int z = 2; z < size.z - 2; ++z) {
        const double covered = share({x + 0.5, y + 0.5, z + 0.5});
        if (covered > 0) sigma.set({x, y, z}, float(std::min(kOpaque, -std::log1p(-std::min(covered, 1 - 1e-9)))));
      }
  return sigma;
}

/// Coverage of voxels by what a signed distance says is inside; exact for planes across an axis.
inline std::function<double(Vec3d)> inside_of(std::function<double(Vec3d)> distance) {
  return [distance = std::move(distance)](Vec3d p) { return std::clamp(0.5 - distance(p), 0.0, 1.0); };
}

inline SurfaceMesh sphere_surface(int side, double radius, double adaptivity = 0) {
  const Vec3d centre{side / 2.0, side / 2.0, side / 2.0};
  const auto sphere = inside_of([=](Vec3d p) { return length(p - centre) - radius; });
  return extract_surface(covered_voxels({side, side, side}, sphere), 1, 1, adaptivity);
}

/// A ball whose radius varies with the direction: valleys, overhangs, and a tunnel through the middle.
inline SurfaceMesh bumpy_surface(int side) {
  const double half = side / 2.0;
  const auto shape = inside_of([=](Vec3d p) {
    const Vec3d q = p - Vec3d{half, half, half};
    const double bumps = 0.09 * side * std::sin(0.9 * q.x) * std::cos(0.7 * q.y) * std::sin(0.8 * q.z + 1);
    return std::max(length(q) - 0.33 * side - bumps, 0.12 * side - std::hypot(q.x, q.y));
  });
  return extract_surface(covered_voxels({side, side, side}, shape), 1, 1, 0);
}

/// How often each directed edge occurs; a closed, consistently turned surface has every edge once each way.
inline std::map<std::pair<std::uint32_t, std::uint32_t>, int> directed_edges(const SurfaceMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const Triangle& t : mesh.triangles) {
    for (int c = 0; c < 3; ++c) ++edges[{t[c], t[(c + 1) % 3]}];
  }
  return edges;
}

inline bool is_closed(const SurfaceMesh& mesh) {
  const auto edges = directed_edges(mesh);
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    if (back == edges.end() || back->second != count) return false;
  }
  return !edges.empty();
}

}  // namespace cnerf::bake::test
