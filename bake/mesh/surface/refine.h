#pragma once
/// From the raw surface of a density to one worth texturing.

#include "bake/mesh/surface/surface_mesh.h"

namespace cnerf::bake {

/// Drops parts that share no vertex with the rest and whose bounding box is small, and the walls of closed cavities,
/// which nobody outside can see.
/// @param smallest  diagonal of a part's box, as a share of the diagonal of the whole mesh's. The largest part stays.
[[nodiscard]] SurfaceMesh without_loose_parts(const SurfaceMesh& mesh, double smallest);

/// Taubin 1995: a shrinking and a growing step of Laplacian smoothing each round, so that steps between voxels go and
/// the volume stays.
void smooth(SurfaceMesh& mesh, int rounds);

/// At most about `faces` triangles by edge collapses (meshoptimizer), keeping topology; a mesh that cannot be reduced
/// further without losing it keeps more.
[[nodiscard]] SurfaceMesh decimated(const SurfaceMesh& mesh, int faces);

}  // namespace cnerf::bake
