#pragma once
/// Field -> plain coloured voxels.

#include <vector>

#include "bake/bake_levels.h"
#include "bake/baked_volume.h"
#include "src/base/progress.h"

namespace cnerf {

/// Bakes luminance and colour of a field on lattices whose density is known (bake_levels), dilated by
/// `options.dilation` voxels. Densities are in 1/world unit. One volume for each level that holds anything, finest
/// first. The caller fills in `colorizer` and `take` of the results.
/// @param cameras  of the capture: a voxel's luminance is the mean of what they see, and voxels that none sees are
///                 dropped unless `keep_unseen`. Without cameras all voxels are kept.
/// Same result for any number of threads.
/// @throws InputError     when no camera sees anything.
/// @throws ContractError  when the field answers NaN or infinity.
/// @throws Interrupted    on Ctrl-C, between batches of bricks.
[[nodiscard]] std::vector<BakedVolume> bake_volumes(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                                    const std::vector<BakeLevel>& levels, const BakeOptions& options,
                                                    const ProgressSink& progress = {});

/// The density of a bake, with progress on the same line as bake_volumes.
/// @throws UsageError, InputError, ContractError  as bake_levels.  @throws Interrupted.
[[nodiscard]] std::vector<BakeLevel> bake_levels(const ColorField& field, std::vector<BakePlan> plans,
                                                 const BakeOptions& options, const ProgressSink& progress);

/// Both, on one lattice whatever `options.grids` says.
[[nodiscard]] BakedVolume bake_volume(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                      const BakeOptions& options, const ProgressSink& progress = {});

}  // namespace cnerf
