#pragma once
/// Nested grids of a bake -> the levels of a web bundle.

#include <vector>

#include "export/web_bricks.h"

namespace cnerf::exporting {

/// In a bake, a coarser grid is empty where a finer one lies, and renderers add all of them up. In a bundle every level
/// stands by itself: a coarser one also holds what finer ones hold, averaged (see merged_volume), so that it is a
/// picture before they are loaded and where they are left out. A finer level answers for everything within its `cover`,
/// and around it has a layer of voxels with what the coarser one interpolates there: values go on across its border.
/// Where a coarser level has no stored brick, finer ones have nothing either.
/// @param volumes     finest first, faces on faces, as bake_volumes makes them; those without density are left out.
/// @param resolution  voxels along the longest axis of a level, at most.
/// @return coarsest first.
/// @throws ContractError  when no voxel has density.
[[nodiscard]] std::vector<WebBricks> make_web_levels(std::vector<bake::Volume> volumes, int resolution);

}  // namespace cnerf::exporting
