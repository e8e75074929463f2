#include "src/capture/image_header.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <string>
#include <system_error>

#include "src/base/error.h"
#include "src/capture/exr_io.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

/// Big-endian numbers of a file, and its end in good time.
class Bytes {
 public:
  explicit Bytes(const fs::path& file) : in_(file, std::ios::binary) {}

  /// The next number of `size` bytes; nothing behind the end.
  [[nodiscard]] std::optional<std::uint32_t> next(int size) {
    std::uint32_t value = 0;
    for (int i = 0; i < size; ++i) {
      const int byte = in_.get();
      if (byte == std::ifstream::traits_type::eof()) return std::nullopt;
      value = value << 8 | std::uint32_t(byte);
    }
    return value;
  }
  void skip(std::int64_t count) { in_.seekg(count, std::ios::cur); }

 private:
  std::ifstream in_;
};

/// The chunk IHDR, which is the first; the file stands behind the signature.
std::optional<ImageHeader> png_header(Bytes& bytes, const fs::path& file) {
  constexpr std::uint32_t kIhdr = 0x49484452;
  const auto length = bytes.next(4), name = bytes.next(4), width = bytes.next(4), height = bytes.next(4);
  const auto bits = bytes.next(1), color = bytes.next(1);
  if (!color || *length != 13 || *name != kIhdr) return std::nullopt;
  check_image_size(file, *width, *height);
  enum : std::uint32_t { kColorBit = 2, kAlphaBit = 4 };
  return ImageHeader{int(*width), int(*height), *bits == 16 ? PixelDepth::kU16 : PixelDepth::kU8,
                     (*color & kColorBit) != 0, (*color & kAlphaBit) != 0};
}

/// The first frame header, SOF0 to SOF15, among the segments; the file stands behind the marker SOI.
std::optional<ImageHeader> jpeg_header(Bytes& bytes, const fs::path& file) {
  for (auto byte = bytes.next(1); byte; byte = bytes.next(1)) {
    if (*byte != 0xFF) return std::nullopt;
    while (byte && *byte == 0xFF) byte = bytes.next(1);  // fill bytes
    const auto length = bytes.next(2);
    if (!length || *length < 2 || *byte == 0xDA) return std::nullopt;
    const bool is_frame = *byte >= 0xC0 && *byte <= 0xCF && *byte != 0xC4 && *byte != 0xC8 && *byte != 0xCC;
    if (!is_frame) {
      bytes.skip(std::int64_t(*length) - 2);
      continue;
    }
    const auto bits = bytes.next(1), height = bytes.next(2), width = bytes.next(2), channels = bytes.next(1);
    if (!channels || *bits != 8) return std::nullopt;
    check_image_size(file, *width, *height);
    return ImageHeader{int(*width), int(*height), PixelDepth::kU8, *channels >= 3, false};
  }
  return std::nullopt;
}

}  // namespace

std::string lower_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension;
}

std::string size_text(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

void check_image_size(const fs::path& file, std::int64_t width, std::int64_t height, const char* field) {
  if (width >= 1 && height >= 1 && width <= kMostPixels / height) return;
  throw InputError(
      file, field,
      "expected 1 to " + std::to_string(kMostPixels >> 20) + " Mi pixels, found " + size_text(width, height));
}

std::optional<ImageHeader> stated_header(const fs::path& file) {
  std::error_code failure;
  if (!fs::exists(file, failure)) throw MissingInputError(file.string() + ": no such file");
  if (!fs::is_regular_file(file, failure)) throw InputError(file, "", "expected an image file");
  if (is_exr(file)) return exr_header(file);
  Bytes bytes(file);
  const auto first = bytes.next(2);
  if (first == 0xFFD8) return jpeg_header(bytes, file);
  constexpr std::uint32_t kPng = 0x8950, kPngNext = 0x4E470D0A, kPngLast = 0x1A0A;
  if (first == kPng && bytes.next(4) == kPngNext && bytes.next(2) == kPngLast) return png_header(bytes, file);
  return std::nullopt;
}

}  // namespace cnerf
