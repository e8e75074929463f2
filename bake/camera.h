#pragma once
/// A camera of the capture as bakes and exports carry it: plain data, no image.

#include <string>
#include <vector>

#include "src/capture/capture.h"

namespace cnerf::bake {

struct Camera {
  std::string name;           ///< as the poses name the view
  Intrinsics intrinsics;      ///< pixels; conventions of camera.h
  Affined world_from_camera;  ///< rigid; OpenCV camera axes
};

/// Of all views, held-out ones included: no photograph is looked at.
[[nodiscard]] inline std::vector<Camera> cameras_of(const Capture& capture) {
  std::vector<Camera> cameras;
  for (const View& view : capture.views) cameras.push_back({view.name, view.intrinsics, view.world_from_camera});
  return cameras;
}

}  // namespace cnerf::bake
