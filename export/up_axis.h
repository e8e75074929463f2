#pragma once
/// Worlds that stand up: programs differ in the axis that points up, captures too.

#include <string>

#include "src/base/check.h"
#include "src/base/vec3.h"

namespace cnerf::exporting {

/// The rotation that takes an axis of the poses' frame to +Y (`to` "y", as glTF and Houdini have it) or +Z ("z").
/// Z-up becomes Y-up by (x, y, z) -> (x, z, -y), which Blender's glTF importer undoes.
/// @param up_axis  "x", "y" or "z".  @throws ContractError  on other names.
[[nodiscard]] inline Affined turned_up(const std::string& up_axis, const std::string& to) {
  CNERF_CHECK(to == "y" || to == "z", to);
  CNERF_CHECK(up_axis == "x" || up_axis == "y" || up_axis == "z", up_axis);
  if (up_axis == to) return {};
  const Mat3d y_up_from_x{{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}}, y_up_from_z{{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}};
  const Mat3d y_up = up_axis == "x" ? y_up_from_x : up_axis == "y" ? Mat3d::identity() : y_up_from_z;
  return {to == "y" ? y_up : y_up_from_z.transposed() * y_up, {}};
}

}  // namespace cnerf::exporting
