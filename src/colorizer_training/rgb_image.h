#pragma once
/// 8-bit sRGB images in memory: decoding, resizing, writing. No Torch, so that many threads can prepare data.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

namespace cnerf {

struct RgbImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< [height, width, 3] sRGB

  [[nodiscard]] int short_side() const { return width < height ? width : height; }
};

/// Nothing when the bytes are no image of a known format: JPEG and WebP, and what OpenCV reads where it is built in.
[[nodiscard]] std::optional<RgbImage> decode_image(std::span<const std::byte> content);

/// Area average where it shrinks, bilinear where it grows; any aspect.
[[nodiscard]] RgbImage resize_image(const RgbImage& image, int width, int height);

/// The pixels [x, x + width) x [y, y + height).
[[nodiscard]] RgbImage crop_image(const RgbImage& image, int x, int y, int width, int height);

/// Uncompressed PNG, since the training machine may have no image library.  @throws OutputError.
void write_png(const std::filesystem::path& file, const RgbImage& image);

}  // namespace cnerf
