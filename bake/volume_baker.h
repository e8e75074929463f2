#pragma once
/// Field -> plain coloured voxels.

#include <vector>

#include "bake/bake_journal.h"
#include "bake/bake_levels.h"
#include "bake/volume_planes.h"
#include "src/base/progress.h"

namespace cnerf {

/// Planes of bricks that are baked at the same time, so that the GPU and the threads wait less for each other; one
/// where memory is limited. It takes several threads to bake one.
[[nodiscard]] std::size_t planes_at_a_time(const BakeOptions& options);

/// First half of a bake: density on each lattice of plan_levels, 1/world unit. What the journal has of it is not made
/// again; what is made goes there.
/// @param journal  of this bake and no other, see bake_journal.h.
/// @throws InputError     when nothing is as opaque as `opacity_threshold`.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
/// @throws OutputError    when the journal cannot be written.
/// @throws Interrupted    on Ctrl-C, between planes of bricks.
[[nodiscard]] std::vector<BakeLevel> bake_levels(const ColorField& field, const std::vector<BakePlan>& plans,
                                                 const BakeOptions& options, BakeJournal& journal,
                                                 const ProgressSink& progress = {});

/// Second half: luminance and colour on lattices whose density is known (bake_levels), not dilated. One volume for each
/// level that holds anything, finest first. The caller fills in `colorizer` and `take` of the results.
/// @param cameras  of the capture: a voxel's luminance is the mean of what they see, and voxels that none sees are
///                 dropped unless `keep_unseen`. Without cameras all voxels are kept.
/// @param journal  the same; it must outlive the results, whose voxels stay there. `levels` need not.
/// Same result for any number of threads, and however often the bake was stopped in between.
/// @throws InputError     when no camera sees anything.
/// @throws ContractError  when the field answers NaN or infinity.
/// @throws OutputError, Interrupted  as bake_levels.
[[nodiscard]] std::vector<VolumePlanes> bake_volumes(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                                     const std::vector<BakeLevel>& levels, const BakeOptions& options,
                                                     BakeJournal& journal, const ProgressSink& progress = {});

/// Both, on one lattice whatever `options.grids` says, in memory; colours are dilated by `options.dilation`.
[[nodiscard]] BakedVolume bake_volume(const ColorField& field, const std::vector<BakeCamera>& cameras,
                                      const BakeOptions& options, const ProgressSink& progress = {});

}  // namespace cnerf
