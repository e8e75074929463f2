#pragma once
/// What the cameras of a capture look at.

#include <vector>

#include "src/capture/capture.h"

namespace cnerf {

/// The point nearest to all optical axes in the least-squares sense; the cameras' mean plus a step forward where the
/// axes are parallel and no such point is well defined. World space.
[[nodiscard]] Vec3d focus_point(const std::vector<View>& views);

}  // namespace cnerf
