#pragma once
/// Where the field's box lies.

#include "src/capture/capture.h"
#include "src/field/scene_frame.h"
#include "src/train/luminance/stage1_options.h"

namespace cnerf {

/// Chooses the field's box for a capture. Deterministic.
/// @param points       of the scene: they tell how far it reaches where nothing else does
/// @throws UsageError  when the options' centre is not three numbers.
/// @throws InputError  the cameras all stand in one place, which tells no depth
[[nodiscard]] SceneFrame place_scene(const Capture& capture, const PlacementOptions& options,
                                     const std::vector<SparsePoint>& points);
[[nodiscard]] inline SceneFrame place_scene(const Capture& capture, const PlacementOptions& options) {
  return place_scene(capture, options, capture.points);
}

}  // namespace cnerf
