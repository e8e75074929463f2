#pragma once
/// Camera paths on disk, in the manner of transforms.json.

#include <filesystem>
#include <vector>

#include "src/render/camera_path.h"

namespace cnerf {

/// See `path_from_file`.
[[nodiscard]] std::vector<PathCamera> read_path_file(const std::filesystem::path& file);

}  // namespace cnerf
