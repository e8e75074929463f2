#include "src/picture/picture.h"

#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf {

SrgbCodes::SrgbCodes() {
  for (std::size_t code = 1; code < 256; ++code) {
    const double border = linear_from_srgb((double(code) - 0.5) / 255);
    begins_[code] = std::nextafter(float(border), 0.0f);
    while (double(begins_[code]) < border) begins_[code] = std::nextafter(begins_[code], 1.0f);
  }
  begins_[256] = 2;
  for (std::size_t cell = 0, code = 0; cell < kCells; ++cell) {
    while (float(cell) / kCells >= begins_[code + 1]) ++code;
    first_[cell] = std::uint8_t(code);
  }
}

const SrgbCodes& SrgbCodes::table() {
  static const SrgbCodes codes;
  return codes;
}

std::vector<std::uint8_t> srgb8_from_linear(std::span<const float> linear) {
  constexpr std::size_t kGrain = 1 << 14;  // values of a parallel piece of work
  std::vector<std::uint8_t> codes(linear.size());
  parallel_each(codes.size(), kGrain, [&](std::size_t i) { codes[i] = srgb8_from_linear(linear[i]); });
  return codes;
}

Picture picture_from_linear(int width, int height, std::span<const float> linear) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  std::vector<std::uint8_t> codes = srgb8_from_linear(linear);
  if (codes.size() == 3 * pixels) return {width, height, std::move(codes)};
  CNERF_CHECK_EQ(codes.size(), pixels);
  Picture picture{width, height, std::vector<std::uint8_t>(3 * pixels)};
  for (std::size_t i = 0; i < pixels; ++i) std::fill_n(picture.rgb.begin() + std::ptrdiff_t(3 * i), 3, codes[i]);
  return picture;
}

std::vector<float> linear_rgb_from_lab(std::span<const float> lightness, std::span<const float> ab) {
  const std::size_t pixels = lightness.size();
  if (!ab.empty()) CNERF_CHECK_EQ(ab.size(), 2 * pixels);
  std::vector<float> linear;
  linear.reserve(3 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const Ab color = ab.empty() ? Ab{} : Ab{ab[i], ab[pixels + i]};
    const Vec3f rgb = gamut_mapped_linear_rgb_from_lab<float>({lightness[i], color.a, color.b});
    linear.insert(linear.end(), {rgb.x, rgb.y, rgb.z});
  }
  return linear;
}

Picture scaled_down(const Picture& picture, int width) {
  if (picture.width <= width) return picture;
  const cv::Mat whole(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
  const int height = std::max(1, picture.height * width / picture.width);
  Picture small{width, height, std::vector<std::uint8_t>(std::size_t(3) * std::size_t(width) * std::size_t(height))};
  cv::Mat target(height, width, CV_8UC3, small.rgb.data());
  cv::resize(whole, target, target.size(), 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace cnerf
