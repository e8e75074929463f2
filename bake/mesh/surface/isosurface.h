#pragma once
/// Density -> surface.

#include <vector>

#include "bake/camera.h"
#include "bake/lattice/brick_grid.h"
#include "bake/lattice/plan.h"
#include "bake/mesh/surface/surface_mesh.h"
#include "bake/options.h"

namespace cnerf::bake {

/// Makes the inside of things solid. A field knows nothing of what no camera saw: behind surfaces it is hollow here and
/// full of debris there, and its isosurface would be mostly walls that nobody ever sees.
///
/// @return a copy of the density in which every voxel is opaque that is hidden: light reaches it neither from a camera
/// nor from outside along more than a few of 26 directions (faces, edges and corners of a cube); a few, since walls
/// that no camera saw have holes. The shadow below an object is not hidden: it is open to that side. Hollows larger
/// than a brick may stay as closed cavities.
[[nodiscard]] BrickGrid<float> solidified(const BrickGrid<float>& sigma, const std::vector<Camera>& cameras,
                                          const Plan& plan, const Options& options);

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
