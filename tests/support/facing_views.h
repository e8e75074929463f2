#pragma once
/// Cameras in a row at z = 0 that look along z; without pictures.

#include <vector>

#include "src/capture/capture.h"

namespace cnerf::test {

/// @param side  of the pictures, pixels, and the focal length
/// @param step  from one camera to the next, world units
[[nodiscard]] inline std::vector<View> facing_views(int count, int side, double step) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    View view;
    view.intrinsics.width = view.intrinsics.height = side;
    view.intrinsics.fx = view.intrinsics.fy = side;
    view.intrinsics.cx = view.intrinsics.cy = 0.5 * side;
    view.world_from_camera = {Mat3d::identity(), {step * i, 0, 0}};
    views.push_back(view);
  }
  return views;
}

}  // namespace cnerf::test
