#pragma once
/// Density -> surface.

#include "bake/lattice/brick_grid.h"
#include "bake/mesh/surface/surface_mesh.h"

namespace cnerf::bake {

/// The surface where `depth` voxels of the matter at hand let half of the light through. What is interpolated between
/// voxels is the share of light that `depth` voxels take, not density: a voxel half covered by something opaque then
/// puts the surface in its middle, whatever the density behind it.
/// Closed, facing outward, adaptive: flat parts have larger faces. Quads are split along their shorter diagonal.
/// @param sigma       1/world unit, cell-centred; 0 along the border of its box.
/// @param voxel_size  world units.
/// @param adaptivity  0 to 1, see openvdb::tools::volumeToMesh.
[[nodiscard]] SurfaceMesh extract_surface(const BrickGrid<float>& sigma, double voxel_size, double depth,
                                          double adaptivity);

}  // namespace cnerf::bake
