#pragma once
/// Makes the inside of things solid. A field knows nothing of what no camera saw: behind surfaces it is hollow here and
/// full of debris there, and its isosurface would be mostly walls that nobody ever sees.

#include <vector>

#include "bake/camera.h"
#include "bake/lattice/brick_grid.h"
#include "bake/lattice/plan.h"
#include "bake/options.h"

namespace cnerf::bake {

/// A copy of the density in which every voxel is opaque that is hidden: light reaches it neither from a camera nor from
/// outside along more than a few of 26 directions (faces, edges and corners of a cube); a few, since walls that no
/// camera saw have holes. The shadow below an object is not hidden: it is open to that side. Hollows larger than a
/// brick may stay as closed cavities.
[[nodiscard]] BrickGrid<float> solidified(const BrickGrid<float>& sigma, const std::vector<Camera>& cameras,
                                          const Plan& plan, const Options& options);

}  // namespace cnerf::bake
