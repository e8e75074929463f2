#pragma once
/// Field -> plain coloured voxels.

#include <vector>

#include "bake/density/levels.h"
#include "bake/out_of_core/journal.h"
#include "bake/out_of_core/planes.h"
#include "bake/visibility/view_selection.h"
#include "src/base/progress.h"

namespace cnerf::bake {

/// Second half: luminance and colour on lattices whose density is known (bake_levels), not dilated. One volume for each
/// level that has density, finest first.
/// @param views    of the capture's cameras, in the light of these levels: a voxel's luminance is the mean of what they
///                 see, and voxels that none sees are dropped unless `keep_unseen`. Without cameras all are kept.
/// @param journal  the same; it must outlive the results, whose voxels stay there. `levels` need not.
/// Same result for any number of threads, and however often the bake was stopped in between.
/// @throws InputError     when no camera sees anything.
/// @throws ContractError  when the field answers NaN or infinity.
/// @throws OutputError, Interrupted  as bake_levels.
[[nodiscard]] std::vector<VolumePlanes> bake_volumes(const ColorField& field, const ViewSelection& views,
                                                     const std::vector<Level>& levels, const Options& options,
                                                     Journal& journal, const ProgressSink& progress = {});

}  // namespace cnerf::bake
