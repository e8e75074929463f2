#pragma once
/// What rays see once stage 1 is trained: the field, and the sky behind it.

#include <span>

#include "src/engine/luminance_engine.h"
#include "src/render/direction_map.h"
#include "src/render/march.h"

namespace cnerf {

struct SeenScene {
  const LuminanceEngine& engine;
  MarchSettings march;
  DirectionView sky = {};  ///< linear Y; without values there is none
};

/// Light that reaches the camera from behind what is seen; 0 without a sky.
[[nodiscard]] inline float light_behind(const DirectionView& sky, const Ray& ray, float opacity) {
  return sky.values == nullptr || opacity >= 1 ? 0.0f : (1 - opacity) * sky.along(ray.direction);
}
/// Puts the sky behind what rays see; opacities stay those of the field.
inline void add_sky(const DirectionView& sky, std::span<const Ray> rays, std::span<RayResult> results) {
  for (std::size_t r = 0; r < results.size(); ++r) {
    results[r].luminance += light_behind(sky, rays[r], results[r].opacity);
  }
}

}  // namespace cnerf
