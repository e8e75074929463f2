#include "src/picture/colored_photograph.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/picture/picture.h"

namespace cnerf {
namespace {

constexpr float kLargestCode = 65535.0f;

std::uint16_t code_of(float value) {
  return std::uint16_t(std::lround(kLargestCode * std::clamp(value, 0.0f, 1.0f)));
}

}  // namespace

cv::Mat colored_photograph(const GreyPhotograph& photograph, const ChromaSamples& chroma) {
  const auto width = std::size_t(photograph.width), height = std::size_t(photograph.height);
  CNERF_CHECK_EQ(photograph.luminance.size(), width * height);
  const bool has_alpha = !photograph.alpha.empty();
  if (has_alpha) CNERF_CHECK_EQ(photograph.alpha.size(), width * height);
  const JointUpsampler upsampler(chroma, photograph.width, photograph.height);
  const int channels = has_alpha ? 4 : 3;
  cv::Mat picture(photograph.height, photograph.width, CV_16UC(channels));
  parallel_tasks(height, [&](std::size_t row) {
    auto* pixel = picture.ptr<std::uint16_t>(int(row));
    for (std::size_t column = 0; column < width; ++column, pixel += channels) {
      const std::size_t place = row * width + column;
      const float luminance = std::clamp(photograph.luminance[place], 0.0f, 1.0f);
      const Ab color = upsampler.at(int(column), int(row), lightness_from_luminance(luminance));
      const Vec3f rgb = linear_rgb_at(luminance, color);
      for (int c = 0; c < 3; ++c) pixel[2 - c] = code_of(srgb_from_linear(rgb[c]));
      if (has_alpha) pixel[3] = code_of(photograph.alpha[place]);
    }
  });
  return picture;
}

}  // namespace cnerf
