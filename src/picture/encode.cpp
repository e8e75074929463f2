#include "src/picture/encode.h"

#include <array>
#include <new>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/picture/codecs.h"

namespace cnerf {
namespace {

/// The signature and the IHDR chunk of a PNG file, bytes; chunks about colour follow them.
constexpr std::ptrdiff_t kPngHeader = 8 + 25;
/// The chunk sRGB: its length, name, rendering intent (perceptual) and CRC (PNG specification, 11.3.2.5).
constexpr std::array<std::uint8_t, 13> kSrgbChunk = {0, 0, 0, 1, 's', 'R', 'G', 'B', 0, 0xAE, 0xCE, 0x1C, 0xE9};

/// @param format  a file extension
/// @param who     named in an error
std::vector<std::uint8_t> encoded(const std::string& format, const cv::Mat& picture, const std::vector<int>& options,
                                  const std::string& who = {}) {
  std::vector<std::uint8_t> bytes;
  bool done = false;
  try {
    done = encode_image(format, picture, bytes, options);
  } catch (const cv::Exception& error) {  // a size or type that the format has not
    if (error.code == cv::Error::StsNoMem) throw std::bad_alloc();
  }
  // A picture in memory has all that a PNG needs; libpng ends without memory, and does not say so.
  if (!done && format == ".png" && !picture.empty()) throw std::bad_alloc();
  if (!done) {
    throw OutputError((who.empty() ? "" : who + ": ") + "a picture of " + std::to_string(picture.cols) + " x " +
                      std::to_string(picture.rows) + " pixels cannot be encoded as " + format.substr(1));
  }
  return bytes;
}

std::vector<std::byte> as_vector(const std::vector<std::uint8_t>& bytes) {
  const auto raw = std::as_bytes(std::span(bytes));
  return {raw.begin(), raw.end()};
}

}  // namespace

cv::Mat bgr_of(const Picture& picture) {
  const cv::Mat rgb(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  return bgr;
}

std::vector<std::byte> png_bytes(const Picture& picture, PngEffort save) {
  std::vector<int> options;
  if (save == PngEffort::kBytes) options = {cv::IMWRITE_PNG_COMPRESSION, 9};
  return as_vector(encoded(".png", bgr_of(picture), options));
}

std::vector<std::byte> png_bytes(const cv::Mat& picture) {
  return as_vector(encoded(".png", picture, {}));
}

std::vector<std::byte> jpeg_bytes(const cv::Mat& picture, int quality) {
  return as_vector(encoded(".jpg", picture, {cv::IMWRITE_JPEG_QUALITY, quality}));
}

std::vector<std::byte> jpeg_bytes(const Picture& picture, int quality) {
  return jpeg_bytes(bgr_of(picture), quality);
}

std::vector<std::byte> webp_bytes(const cv::Mat& picture, int quality) {
  return as_vector(encoded(".webp", picture, {cv::IMWRITE_WEBP_QUALITY, quality}));
}

void write_png(const std::filesystem::path& file, const cv::Mat& picture) {
  const std::vector<std::uint8_t> bytes = encoded(".png", picture, {}, file.string());
  write_file(file, std::as_bytes(std::span(bytes)));
}

void write_srgb_png(const std::filesystem::path& file, const cv::Mat& picture) {
  std::vector<std::uint8_t> bytes = encoded(".png", picture, {}, file.string());
  bytes.insert(bytes.begin() + kPngHeader, kSrgbChunk.begin(), kSrgbChunk.end());
  write_file(file, std::as_bytes(std::span(bytes)));
}

void write_tiff(const std::filesystem::path& file, const cv::Mat& picture) {
  const std::vector<std::uint8_t> bytes = encoded(".tiff", picture, {}, file.string());
  write_file(file, std::as_bytes(std::span(bytes)));
}

void write_png(const std::filesystem::path& file, const Picture& picture) {
  write_png(file, bgr_of(picture));
}

}  // namespace cnerf
