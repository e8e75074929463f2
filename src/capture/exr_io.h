#pragma once
/// OpenEXR files: captures in scene-linear light, and depth maps.

#include <filesystem>
#include <span>

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

/// Writes one float channel, ZIP compressed, whole or not at all.  @param values  [height, width].
/// @throws OutputError.
void write_exr_channel(const std::filesystem::path& file, const char* channel, int width, int height,
                       std::span<const float> values);

}  // namespace cnerf
