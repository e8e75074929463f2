#pragma once
/// Views of a wall with a board before it: geometry that is known, for tests of what one view knows of another.

#include "src/train/luminance/view_cache.h"

namespace cnerf::test {

inline constexpr int kWidth = 60, kHeight = 40;
inline constexpr float kWall = 0.8f, kBoard = 0.4f;  // z of a wall, and of a board before a part of it

/// A pinhole camera that looks along z at the wall, and at the board where it stands in the way.
inline CachedView look(float x, bool has_board, float luminance = 0.3f) {
  CachedView view;
  view.width = kWidth, view.height = kHeight;
  view.camera.intrinsics = {LensModel::kPinhole, kWidth, kHeight, 50, 50, kWidth / 2.0, kHeight / 2.0, {}};
  view.camera.unit_from_camera = Mat3d::from_columns({1, 0, 0}, {0, 1, 0}, {0, 0, 1});
  view.camera.origin = {double(x), 0.5, 0.0};
  view.offsets.push_back(0);
  for (int py = 0; py < kHeight; ++py) {
    for (int px = 0; px < kWidth; ++px) {
      const Ray ray = view.camera.ray({px + 0.5, py + 0.5});
      const float to_board = kBoard / ray.direction.z, to_wall = kWall / ray.direction.z;
      const float board_x = ray.at(to_board).x;
      const bool hits_board = has_board && board_x > 0.45f && board_x < 0.55f;
      view.samples.push_back({hits_board ? to_board : to_wall, 65535, 65535});
      view.offsets.push_back(view.samples.size());
      view.luminance.push_back(luminance);
      view.opacity.push_back(1.0f);
    }
  }
  return view;
}

}  // namespace cnerf::test
