#pragma once
/// A triangle mesh while it is being made: shared vertices, no normals, no texture. And what makes the raw surface of a
/// density one worth texturing.

#include <cstdint>
#include <span>
#include <vector>

#include "bake/mesh.h"
#include "src/base/vec3.h"

namespace cnerf::bake {

struct SurfaceMesh {
  std::vector<Vec3f> positions;  ///< voxel coordinates: voxel ijk covers [ijk, ijk + 1)
  std::vector<Triangle> triangles;
};

/// Twice the area, along the normal.
[[nodiscard]] inline Vec3f area_vector(const SurfaceMesh& mesh, const Triangle& t) {
  const Vec3f& a = mesh.positions[t[0]];
  return cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
}

/// Unit normal; (0, 0, 0) for a triangle without area.
[[nodiscard]] inline Vec3f face_normal(const SurfaceMesh& mesh, const Triangle& t) {
  const Vec3f area = area_vector(mesh, t);
  const float size = length(area);
  return size > 0 ? area / size : Vec3f{};
}

/// Normals of vertices: of the faces around them, weighted by their angle there.  [positions]
[[nodiscard]] std::vector<Vec3f> vertex_normals(const SurfaceMesh& mesh);

/// Volume inside, positive when the surface faces outward; of closed surfaces.
[[nodiscard]] double signed_volume(const SurfaceMesh& mesh);

/// Removes vertices that no triangle uses and triangles that use one twice; the order of the rest stays.
void compact(SurfaceMesh& mesh);

/// Splits a mesh into parts that share no vertex, each in the order of its first triangle.
[[nodiscard]] std::vector<SurfaceMesh> connected_parts(const SurfaceMesh& mesh);

/// Drops parts that share no vertex with the rest and whose bounding box is small, and the walls of closed cavities,
/// which nobody outside can see. Where cameras are in a cavity, as those of a room, it stays, and what is around all of
/// them goes: the room's outside.
/// @param smallest   diagonal of a part's box, as a share of the diagonal of the whole mesh's. The largest part stays.
/// @param seen_from  centres of cameras, voxel coordinates
[[nodiscard]] SurfaceMesh without_loose_parts(const SurfaceMesh& mesh, double smallest,
                                              std::span<const Vec3f> seen_from = {});

/// Taubin 1995: a shrinking and a growing step of Laplacian smoothing each round, so that steps between voxels go and
/// the volume stays.
void smooth(SurfaceMesh& mesh, int rounds);

/// At most about `faces` triangles by edge collapses (meshoptimizer), keeping topology; a mesh that cannot be reduced
/// further without losing it keeps more.
[[nodiscard]] SurfaceMesh decimated(const SurfaceMesh& mesh, int faces);

}  // namespace cnerf::bake
