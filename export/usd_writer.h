#pragma once
/// A USD scene that places the grids of a bake, for programs that read OpenVDB through USD.

#include <filesystem>
#include <string>
#include <vector>

#include "export/manifest.h"

namespace cnerf::exporting {

/// Writes a .usda with one Volume prim for each file and an OpenVDBAsset field for each of its grids `density`,
/// `color`, `luminance`, `lab_a`, `lab_b`. Files are named relative to the scene. USD knows Y and Z as up axes: an X-up
/// frame is turned by a transform of the root.
/// @param up_axis  of the files' world, "x", "y" or "z".
/// @throws OutputError.
void write_usd(const std::vector<ManifestVolume>& volumes, const std::string& up_axis, const Label& label,
               const std::filesystem::path& file);

}  // namespace cnerf::exporting
