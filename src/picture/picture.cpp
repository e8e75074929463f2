#include "src/picture/picture.h"

#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

constexpr std::size_t kAtOnce = 64;  // pixels that become vector instructions
constexpr int kChromaSteps = 12;     // chroma to 1 of 4096: no more is seen in 8 bits

using Channel = std::array<float, kAtOnce>;

/// As `gamut_mapped_linear_rgb_from_lab`, to the bit where nothing leaves the gamut, of the first `count` pixels.
void linear_from_lab(std::size_t count, const Channel& lightness, const Channel& a, const Channel& b,
                     std::array<Channel, 3>& linear) {
  Channel excess;  // beyond the gamut; 0 or less: inside
  for (std::size_t i = 0; i < kAtOnce; ++i) {
    const float l = lightness[i] > 0 ? lightness[i] : 0;
    const Vec3f rgb = linear_rgb_from_lab<float>({l, a[i], b[i]});
    const float grey = luminance_from_lightness(l), limit = grey > 1 ? grey : 1;
    linear[0][i] = rgb.x;
    linear[1][i] = rgb.y;
    linear[2][i] = rgb.z;
    const float below = -std::min(std::min(rgb.x, rgb.y), rgb.z),
                above = std::max(std::max(rgb.x, rgb.y), rgb.z) - limit;
    excess[i] = std::max(below, above);
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (excess[i] <= 0) continue;
    const Vec3f rgb = gamut_mapped_linear_rgb_from_lab<float>({lightness[i], a[i], b[i]}, kChromaSteps);
    for (std::size_t c = 0; c < 3; ++c) linear[c][i] = rgb[int(c)];
  }
}

}  // namespace

SrgbCodes::SrgbCodes() {
  for (std::size_t code = 1; code < 256; ++code) {
    const double border = linear_from_srgb((double(code) - 0.5) / 255);
    begins_[code] = std::nextafter(float(border), 0.0f);
    while (double(begins_[code]) < border) begins_[code] = std::nextafter(begins_[code], 1.0f);
  }
  begins_[256] = 2;
  for (std::size_t cell = 0, code = 0; cell <= kCells; ++cell) {
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

void srgb8_from_lab(std::span<const float> lightness, std::span<const float> a, std::span<const float> b, float gain,
                    std::span<std::uint8_t> rgb) {
  const bool is_grey = a.empty();
  CNERF_CHECK_EQ(rgb.size(), 3 * lightness.size());
  CNERF_CHECK(a.size() == b.size() && (is_grey || a.size() == lightness.size()), "as many a and b as pixels, or none");
  const SrgbCodes& codes = SrgbCodes::table();
  Channel l{}, of_a{}, of_b{};
  std::array<Channel, 3> linear;
  for (std::size_t first = 0; first < lightness.size(); first += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, lightness.size() - first);
    std::uint8_t* const to = &rgb[3 * first];
    std::copy_n(&lightness[first], count, l.begin());
    if (is_grey) {
      for (std::size_t i = 0; i < kAtOnce; ++i) linear[0][i] = luminance_from_lightness(l[i] > 0 ? l[i] : 0);
      for (std::size_t i = 0; i < count; ++i) std::fill_n(to + 3 * i, 3, codes.of(gain * linear[0][i]));
    } else {
      std::copy_n(&a[first], count, of_a.begin());
      std::copy_n(&b[first], count, of_b.begin());
      linear_from_lab(count, l, of_a, of_b, linear);
      for (std::size_t i = 0; i < 3 * count; ++i) to[i] = codes.of(gain * linear[i % 3][i / 3]);
    }
  }
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
