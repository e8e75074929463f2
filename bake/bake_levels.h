#pragma once
/// The lattices of a bake and the density on them: what volumes and meshes are both made from.

#include <functional>
#include <vector>

#include "bake/bake_camera.h"
#include "bake/density_pass.h"

namespace cnerf {

/// One grid of a bake. Where grids are nested, a coarser one has a hole where the next finer one lies.
struct BakeLevel {
  BakePlan plan;
  DensityPass density;
};

/// The lattices of a bake, finest first. The last is that of plan_bake. With `grids` nested (auto: where the field has
/// several cascades) each finer one has voxels half as large and as many of them along its longest axis, and lies where
/// most pixels of the cameras look whose size the coarser voxels exceed more than twice; its faces are faces of coarser
/// voxels. There are no more grids once every voxel covers at most two pixels of the nearest view, or too few pixels
/// would gain, or there are four.
/// @throws UsageError, InputError  as plan_bake.
[[nodiscard]] std::vector<BakePlan> plan_levels(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                                const BakeOptions& options);

/// Memory that Cycles takes for density and colour of these grids: it makes their boxes dense, in 32 bits, colours with
/// four components.
[[nodiscard]] std::size_t cycles_bytes(const std::vector<BakePlan>& plans);

/// plan_levels with voxels as large as `options.budget` asks for, never smaller than without it.
/// @throws UsageError  also when the budget is no amount of memory ("4G", "500M", "800000") or too small for 16 voxels.
[[nodiscard]] std::vector<BakePlan> plan_within_budget(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                                       const BakeOptions& options);

/// Density on each lattice of plan_levels.  @param advance  as in bake_density.
/// @throws UsageError, InputError     as plan_bake; also when nothing is as opaque as `opacity_threshold`.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
[[nodiscard]] std::vector<BakeLevel> bake_levels(const ColorField& field, std::vector<BakePlan> plans,
                                                 const BakeOptions& options,
                                                 const std::function<void(double)>& advance);

}  // namespace cnerf
