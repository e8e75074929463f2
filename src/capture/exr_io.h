#pragma once
/// OpenEXR files of captures, in scene-linear light.

#include <filesystem>

#include "src/capture/image_io.h"

namespace cnerf {

/// True for files that are read as OpenEXR, by their names.
[[nodiscard]] bool is_exr(const std::filesystem::path& file);

/// Sizes are those of the display window.
/// @throws InputError  not an OpenEXR file; windows that no picture has; channels other than those below.
[[nodiscard]] ImageHeader exr_header(const std::filesystem::path& file);

/// Reads channel Y, or R G B, and A where it is there. EXR colours are premultiplied by convention.
/// @throws MissingInputError, InputError.
[[nodiscard]] LinearImage read_exr(const std::filesystem::path& file);

}  // namespace cnerf
