#pragma once
/// A ray as kernels keep it.

#include "src/base/host_device.h"
#include "src/render/ray.h"

namespace cnerf {

struct alignas(16) RayRecord {
  Ray ray;
  float begin = 0, end = -1;  ///< inside the box; begin > end on a miss
  float jitter = 0.5f;
  float target = 0;      ///< training: linear Y of the pixel over black
  float coverage = 1;    ///< training: alpha of the pixel
  float background = 0;  ///< training: linear Y put behind ray and pixel alike
};

}  // namespace cnerf
