#pragma once
/// Pictures -> PNG, JPEG and WebP, in memory and as files.
/// All throw OutputError, which names the file where there is one.

#include <cstddef>
#include <filesystem>
#include <vector>

#include "src/picture/picture.h"

namespace cv {
class Mat;
}

namespace cnerf {

/// What a PNG encoder is to save.
enum class PngEffort { kTime, kBytes };

[[nodiscard]] std::vector<std::byte> png_bytes(const Picture& picture, PngEffort save = PngEffort::kTime);
/// @param quality  0 to 100
[[nodiscard]] std::vector<std::byte> jpeg_bytes(const Picture& picture, int quality);
void write_png(const std::filesystem::path& file, const Picture& picture);

// Of OpenCV's pictures: grey, BGR or BGRA, 8 bits; as PNG also 16 bits.
[[nodiscard]] std::vector<std::byte> png_bytes(const cv::Mat& picture);
[[nodiscard]] std::vector<std::byte> jpeg_bytes(const cv::Mat& picture, int quality);
[[nodiscard]] std::vector<std::byte> webp_bytes(const cv::Mat& picture, int quality);
void write_png(const std::filesystem::path& file, const cv::Mat& picture);
/// A PNG that says that its colours are sRGB.
void write_srgb_png(const std::filesystem::path& file, const cv::Mat& picture);
/// 8 or 16 bits, without loss.
void write_tiff(const std::filesystem::path& file, const cv::Mat& picture);

/// The picture in the order of OpenCV.
[[nodiscard]] cv::Mat bgr_of(const Picture& picture);

}  // namespace cnerf
