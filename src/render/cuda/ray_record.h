#pragma once
/// A ray as kernels keep it.

#include "src/render/observed_ray.h"

namespace cnerf {

struct alignas(16) RayRecord {
  Ray ray;
  float begin = 0, end = -1;  ///< inside the box; begin > end on a miss
  float jitter = 0.5f;
  RayTarget target;        ///< of training rays
  std::uint32_t view = 0;  ///< of training rays
  PicturePlace place;      ///< likewise
};

}  // namespace cnerf
