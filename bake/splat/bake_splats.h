#pragma once
/// Field -> splats.

#include <vector>

#include "bake/splat/options.h"
#include "bake/splat/targets.h"
#include "src/base/observer.h"

namespace cnerf::bake {

struct SplatJob {
  DrawField draw;               ///< the field, called from one thread
  SceneFrame frame;             ///< of the field
  std::vector<Camera> cameras;  ///< of the training views: splats see no held-out one
  SplatOptions options;
};

/// Nearest that anything is drawn, world units.
[[nodiscard]] double nearest_splat(const SceneFrame& frame);

/// Splats that look like the field from the cameras and between them. The same for any number of threads.
/// @throws InputError   where the field shows nothing.
/// @throws Interrupted  when the observer cancels: nothing is kept.
[[nodiscard]] SplatCloud bake_splats(const SplatJob& job, Observer& observer);

}  // namespace cnerf::bake
