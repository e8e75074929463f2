#pragma once
/// Field -> plain coloured voxels.

#include <vector>

#include "bake/bake_camera.h"
#include "bake/bake_options.h"
#include "bake/baked_volume.h"
#include "src/base/progress.h"
#include "src/field/color_field.h"

namespace cnerf {

/// Bakes density, luminance and colour of a field over its occupied bricks, dilated by `options.dilation` voxels.
/// Densities are in 1/world unit. The caller fills in `colorizer` and `take` of the result.
/// @param cameras  of the capture: a voxel's luminance is the mean of what they see, and voxels that none sees are
///                 dropped unless `keep_unseen`. Without cameras all voxels are kept.
/// Same result for any number of threads.
/// @throws UsageError     on options that contradict each other, see plan_bake.
/// @throws InputError     when nothing in the box is dense enough to keep, or no camera sees it.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
/// @throws Interrupted    on Ctrl-C, between batches of bricks.
[[nodiscard]] BakedVolume bake_volume(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                      const BakeOptions& options, const ProgressSink& progress = {});

}  // namespace cnerf
