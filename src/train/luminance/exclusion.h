#pragma once
/// Which space stage 1 leaves out.

#include "src/capture/capture.h"
#include "src/engine/luminance_engine.h"
#include "src/field/scene_frame.h"
#include "src/train/luminance/free_space.h"

namespace cnerf {

/// Leaves out space about which the training views say nothing, so that no fog is learnt and baked there: what none of
/// them sees, what is nearer than the capture's near bound, and what only one or two of them see in front of the point
/// they look at. There each view could hold a picture of its own, just before its lens, and geometry would never form.
/// Behind that point a single view counts: that is where backgrounds are. And space that is known to be free: a view
/// explains what no static scene can, such as a shadow that moved, with veils in front of itself.
void exclude_empty(const Capture& capture, const SceneFrame& frame, const FreeSpace& free_space,
                   LuminanceEngine& engine);

}  // namespace cnerf
