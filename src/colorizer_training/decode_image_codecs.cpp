// JPEG and WebP by their own libraries, for machines without OpenCV.
#include <webp/decode.h>

#include <csetjmp>
#include <cstdio>
// jpeglib.h needs the C types of cstdio before it.
#include <jpeglib.h>

#include "src/colorizer_training/rgb_image.h"

namespace cnerf {
namespace {

struct JpegErrors {
  jpeg_error_mgr manager;
  std::jmp_buf escape;
};

[[noreturn]] void escape_from_jpeg(j_common_ptr info) {
  std::longjmp(reinterpret_cast<JpegErrors*>(info->err)->escape, 1);
}

/// libjpeg reports errors by a jump; `image` is the caller's, so that no destructor is jumped over.
bool decode_jpeg(std::span<const std::byte> content, RgbImage& image) {
  jpeg_decompress_struct info{};
  JpegErrors errors{};
  info.err = jpeg_std_error(&errors.manager);
  errors.manager.error_exit = escape_from_jpeg;
  errors.manager.output_message = [](j_common_ptr) {};
  if (setjmp(errors.escape) != 0) {
    jpeg_destroy_decompress(&info);
    return false;
  }
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(content.data()),
               static_cast<unsigned long>(content.size()));
  jpeg_read_header(&info, TRUE);
  info.out_color_space = JCS_RGB;
  jpeg_start_decompress(&info);
  image.width = int(info.output_width);
  image.height = int(info.output_height);
  image.rgb.resize(std::size_t(image.width) * std::size_t(image.height) * 3);
  while (info.output_scanline < info.output_height) {
    JSAMPROW row = &image.rgb[std::size_t(info.output_scanline) * std::size_t(image.width) * 3];
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  jpeg_destroy_decompress(&info);
  return true;
}

}  // namespace

std::optional<RgbImage> decode_image(std::span<const std::byte> content) {
  RgbImage image;
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(content.data());
  if (WebPGetInfo(bytes, content.size(), &image.width, &image.height)) {
    image.rgb.resize(std::size_t(image.width) * std::size_t(image.height) * 3);
    const bool decoded =
        WebPDecodeRGBInto(bytes, content.size(), image.rgb.data(), image.rgb.size(), image.width * 3) != nullptr;
    return decoded ? std::optional(std::move(image)) : std::nullopt;
  }
  return decode_jpeg(content, image) ? std::optional(std::move(image)) : std::nullopt;
}

}  // namespace cnerf
