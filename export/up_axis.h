#pragma once
/// Worlds that stand up: programs differ in the axis that points up, captures too.

#include <string>

#include "src/base/vec3.h"

namespace cnerf::exporting {

/// The rotation that takes an axis of the poses' frame to +Y (`to` "y", as glTF and Houdini have it) or +Z ("z").
/// Z-up becomes Y-up by (x, y, z) -> (x, z, -y), which Blender's glTF importer undoes.
/// @param up_axis  "x", "y" or "z".  @throws ContractError  on other names.
[[nodiscard]] Affined turned_up(const std::string& up_axis, const std::string& to);

}  // namespace cnerf::exporting
