#pragma once
/// Rays and the samples along them, in unit space.

#include "src/base/vec3.h"

namespace cnerf {

struct Ray {
  Vec3f origin;
  Vec3f direction;  ///< unit length

  [[nodiscard]] CNERF_HD Vec3f at(float t) const { return origin + direction * t; }
};

/// One interval of a ray. `t` is its middle.
struct RaySample {
  float t = 0;
  float dt = 0;
};

}  // namespace cnerf
