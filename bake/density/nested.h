#pragma once
/// Nested lattices: where finer ones lie, what they cost, and how they become one.

#include <vector>

#include "bake/camera.h"
#include "bake/density/levels.h"

namespace cnerf::bake {

/// The lattices of a bake, finest first. The last is that of plan_bake. With `grids` nested (auto: where the field has
/// several cascades) each finer one has voxels half as large and as many of them along its longest axis, and lies where
/// most pixels of the cameras look whose size the coarser voxels exceed more than twice; its faces are faces of coarser
/// voxels. There are no more grids once every voxel covers at most two pixels of the nearest view, or too few pixels
/// would gain, or there are four.
/// @throws UsageError, InputError  as plan_bake.
[[nodiscard]] std::vector<Plan> plan_levels(const ColorField& field, const std::vector<Camera>& cameras,
                                            const Options& options);

/// Memory that Cycles takes for density and colour of these grids: it makes their boxes dense, in 32 bits, colours with
/// four components.
[[nodiscard]] std::size_t cycles_bytes(const std::vector<Plan>& plans);

/// plan_levels with voxels as large as `options.budget` asks for, never smaller than without it.
/// @throws UsageError  also when the budget is no amount of memory ("4G", "500M", "800000") or too small for 16 voxels.
[[nodiscard]] std::vector<Plan> plan_within_budget(const ColorField& field, const std::vector<Camera>& cameras,
                                                   const Options& options);

/// The density of all levels on the lattice of the coarsest: where a finer one lies in its hole, a voxel lets through
/// the mean of what the finer ones there do.  @param levels  finest first, at least one.
[[nodiscard]] Level merged_level(std::vector<Level> levels, const Options& options);

}  // namespace cnerf::bake
