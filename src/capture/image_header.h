#pragma once
/// What the header of an image file states, read without its pixels, and refused where no picture can be meant: a few
/// bytes must not make the program take gigabytes.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "src/capture/mono_image.h"

namespace cnerf {

/// The most pixels of an image, 16384 x 16384. The largest single exposures of today have 151 million.
inline constexpr std::int64_t kMostPixels = std::int64_t(1) << 28;

struct ImageHeader {
  int width = 0, height = 0;
  PixelDepth depth = PixelDepth::kU8;
  bool has_color = false;  ///< three channels, which may all be the same
  bool has_alpha = false;
};

/// The header of a PNG, JPEG or OpenEXR file; nothing for other formats, and for what its decoder had better refuse.
/// @throws MissingInputError, InputError  no such file; a size that no picture has, naming it.
[[nodiscard]] std::optional<ImageHeader> stated_header(const std::filesystem::path& file);

/// ".jpg" of "A.JPG".
[[nodiscard]] std::string lower_extension(const std::filesystem::path& file);

/// "640x480"
[[nodiscard]] std::string size_text(std::int64_t width, std::int64_t height);

/// @throws InputError  unless both sides have a pixel and the image has at most kMostPixels.
void check_image_size(const std::filesystem::path& file, std::int64_t width, std::int64_t height,
                      const char* field = "size");

}  // namespace cnerf
