#pragma once
/// The parts of manifest.json that bundle.json repeats word by word.

#include <nlohmann/json.hpp>
#include <string>

#include "bake/bake_camera.h"
#include "src/field/scene_frame.h"

namespace cnerf {

[[nodiscard]] nlohmann::ordered_json camera_json(const BakeCamera& camera);
[[nodiscard]] nlohmann::ordered_json frame_json(const SceneFrame& frame);
[[nodiscard]] nlohmann::ordered_json color_json(const std::string& colorizer, const std::string& take);

}  // namespace cnerf
