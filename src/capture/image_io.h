#pragma once
/// Image files in linear light, and their way to single-channel images at the depth of the file.
/// PNG, JPEG, TIFF, WebP and what else OpenCV reads; OpenEXR through its own library.

#include <filesystem>
#include <vector>

#include "src/capture/image_header.h"
#include "src/capture/mono_image.h"

namespace cnerf {

/// An image in linear light, composited over black.
struct LinearImage {
  int width = 0, height = 0;
  int channels = 1;                    ///< 1 (luminance) or 3 (Rec.709 R, G, B)
  PixelDepth depth = PixelDepth::kU8;  ///< of the file
  std::vector<float> values;           ///< [H, W, channels], 1 = white
  std::vector<float> alpha;            ///< [H, W] coverage in [0, 1]; empty = opaque

  [[nodiscard]] std::size_t pixel_count() const { return std::size_t(width) * std::size_t(height); }
};

/// Reads stored pixels: an EXIF orientation is ignored, because poses refer to the pixels as they are stored.
/// `transfer` decodes integer files; float files are linear.
/// @throws MissingInputError, InputError  unreadable, cut short, of a type no capture has, or a float is not
///     within +-10^6.
[[nodiscard]] LinearImage read_linear_image(const std::filesystem::path& file, Transfer transfer);

/// What a header would say of the image.
[[nodiscard]] ImageHeader image_header(const LinearImage& image);
/// The header of any file that `read_linear_image` reads; of formats that `stated_header` leaves out it is decoded.
/// @throws  as `read_linear_image`.
[[nodiscard]] ImageHeader image_header(const std::filesystem::path& file);

/// True when no pixel has a colour: one channel, or three equal ones everywhere.
[[nodiscard]] bool is_monochrome(const LinearImage& image);

/// Rec.709 luminance; a grey pixel keeps its value exactly.
[[nodiscard]] LinearImage luminance_image(LinearImage image);

/// Resized by averaging over the area of each new pixel, in linear light.
[[nodiscard]] LinearImage area_resized(const LinearImage& image, int width, int height);

/// Encodes a luminance image with `transfer` at the depth of its file. An alpha channel that is opaque everywhere is
/// dropped.
[[nodiscard]] MonoImage encode_mono(const LinearImage& image, Transfer transfer);

/// A mask of `width` x `height`: 0 where the file is dark, "ignore this pixel", else 255. A file of another size is
/// resized when the ratio is the same; a smaller pixel counts only if all it covers does.
/// @throws MissingInputError, InputError  also where it holds ones, or bytes in 16 bits, in place of white.
[[nodiscard]] std::vector<std::uint8_t> read_mask(const std::filesystem::path& file, int width, int height);

/// True when an image of `width` x `height` can be a resized copy of the stated size: the ratio of the sides is exactly
/// the same, or it was reduced by an integer and rounded to pixels.
[[nodiscard]] bool same_shape(int width, int height, int stated_width, int stated_height);

}  // namespace cnerf
