#pragma once
/// The parts of manifest.json that bundle.json repeats word by word.

#include <nlohmann/json.hpp>

#include "bake/camera.h"
#include "bake/provenance.h"
#include "src/field/scene_frame.h"

namespace cnerf::exporting {

[[nodiscard]] nlohmann::ordered_json camera_json(const bake::Camera& camera);
[[nodiscard]] nlohmann::ordered_json frame_json(const SceneFrame& frame);
[[nodiscard]] nlohmann::ordered_json color_json(const bake::Provenance& provenance);

}  // namespace cnerf::exporting
