#pragma once
/// OpenEXR files: captures in scene-linear light, and depth maps.

#include <filesystem>
#include <span>

#include "src/capture/image_io.h"

namespace cnerf {

/// Reads channel Y, or R G B, and A where it is there. EXR colours are premultiplied by convention.
/// @throws MissingInputError, InputError.
[[nodiscard]] LinearImage read_exr(const std::filesystem::path& file);

/// Writes one float channel, ZIP compressed.  @param values  [height, width].
/// @throws OutputError.
void write_exr_channel(const std::filesystem::path& file, const char* channel, int width, int height,
                       std::span<const float> values);

}  // namespace cnerf
