#pragma once
/// Where the field's box lies.

#include "src/capture/capture.h"
#include "src/field/scene_frame.h"
#include "src/train/luminance/stage1_options.h"

namespace cnerf {

/// Chooses the field's box for a capture. Deterministic.
/// @throws UsageError  when the options' centre is not three numbers.
[[nodiscard]] SceneFrame place_scene(const Capture& capture, const PlacementOptions& options);

}  // namespace cnerf
