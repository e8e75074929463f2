#pragma once
/// Visibility on the device that the engines run on.

#include <memory>
#include <vector>

#include "bake/visibility/view_selection.h"
#include "src/base/observer.h"
#include "src/engine/engines.h"

namespace cnerf::bake {

/// On the GPU if the engines run there; on the processor where they do, and where the GPU's memory does not suffice,
/// which the observer is told.
[[nodiscard]] std::unique_ptr<ViewSelection> select_views(const std::vector<Camera>& cameras,
                                                          std::vector<DensityLevel> levels, const Options& options,
                                                          const Engines& engines, Observer& observer);

}  // namespace cnerf::bake
