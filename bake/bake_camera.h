#pragma once
/// A camera of the capture as bakes and exports carry it: plain data, no image.

#include <string>

#include "src/capture/camera.h"

namespace cnerf {

struct BakeCamera {
  std::string name;           ///< as the poses name the view
  Intrinsics intrinsics;      ///< pixels; conventions of camera.h
  Affined world_from_camera;  ///< rigid; OpenCV camera axes
};

}  // namespace cnerf
