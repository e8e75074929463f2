#pragma once
/// The similarity transform between the frame of the camera poses ("world") and the unit cube of the field ("unit").
/// Every snapshot and bake stores it, so that exports return to the source frame.

#include "src/base/aabb.h"
#include "src/base/vec3.h"

namespace cnerf {

/// unit = scale * (world - world_centre) + (0.5, 0.5, 0.5). The field's box is [0, 1]^3 in unit space.
struct SceneFrame {
  Vec3d world_centre{};
  double unit_per_world = 1;  ///< scale; > 0
  int cascades = 1;  ///< nested boxes around the centre: cascade k has side 2^(k - cascades + 1), the last one 1

  [[nodiscard]] Vec3d unit_from_world(Vec3d p) const {
    return (p - world_centre) * unit_per_world + Vec3d{0.5, 0.5, 0.5};
  }
  [[nodiscard]] Vec3d world_from_unit(Vec3d p) const {
    return (p - Vec3d{0.5, 0.5, 0.5}) / unit_per_world + world_centre;
  }
  [[nodiscard]] Aabbd world_box() const { return {world_from_unit({0, 0, 0}), world_from_unit({1, 1, 1})}; }
  friend bool operator==(const SceneFrame&, const SceneFrame&) = default;
};

}  // namespace cnerf
