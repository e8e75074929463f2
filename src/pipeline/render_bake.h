#pragma once
/// Pictures of a bake, straight from its voxels: what every viewer of it should show.

#include <filesystem>

#include "src/base/observer.h"
#include "src/render/camera_path.h"

namespace cnerf::pipeline {

/// The cameras of the capture that a bake was made of, without lens distortion.
/// @throws MissingInputError, InputError  also where the bake has no volume
[[nodiscard]] CameraPath cameras_of_bake(const std::filesystem::path& bake);

/// Writes a PNG for each camera.
/// @param overwrite  frames that a longer render left go
/// @throws Interrupted  between two pictures
void render_bake(const std::filesystem::path& bake, const CameraPath& path, const std::filesystem::path& folder,
                 bool overwrite, Observer& observer);

}  // namespace cnerf::pipeline
