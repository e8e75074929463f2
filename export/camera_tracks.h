#pragma once
/// The capture's cameras for programs that know nothing of a manifest: as a USD scene and as a Nuke track. Lens
/// distortion has no place in either: plates go with them, which have none.

#include <filesystem>
#include <string>
#include <vector>

#include "bake/camera.h"
#include "export/options.h"

namespace cnerf::exporting {

/// Frames of a shot: the numbers that the pictures' names end with, where each has one of its own; else 1, 2, 3 and so
/// on in the order of the cameras.
struct ShotFrame {
  int number = 0;
  const bake::Camera* camera = nullptr;
};
/// By number.
[[nodiscard]] std::vector<ShotFrame> frames_of_shot(const std::vector<bake::Camera>& cameras);

/// A .usda with a Camera prim for each camera, and `shot`, an animated one that is each of them at its frame. It lies
/// where the bake's .usda does. The horizontal aperture is 36 mm: lenses are in tenths of a unit of the scene, as USD
/// has them, and `metres_per_unit` says how long that is. Offsets hold the principal point.
/// @param up  as VdbOptions::up, for a Y-up or Z-up file.  @throws OutputError
void write_cameras_usd(const std::vector<bake::Camera>& cameras, const VdbOptions& up, const Label& label,
                       const std::filesystem::path& file);

/// A track that Nuke's cameras import, a line per frame: frame, x y z, rotations about X Y Z in degrees of order ZXY
/// (Nuke's own), vertical angle of view in degrees. Y-up, as Nuke is. There is no place for a principal point.
/// @throws OutputError
void write_chan(const std::vector<bake::Camera>& cameras, const WorldConvention& world,
                const std::filesystem::path& file);

}  // namespace cnerf::exporting
