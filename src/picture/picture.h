#pragma once
/// Pictures of 8-bit sRGB, and the ways there from linear light and from CIELAB.

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <span>
#include <vector>

#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"

namespace cnerf {

/// 8-bit sRGB, [H, W, 3].
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
};

/// The 8-bit sRGB code of linear light, clamped and rounded.
template <std::floating_point Real>
[[nodiscard]] std::uint8_t srgb8_from_linear(Real linear) {
  return std::uint8_t(std::lround(Real(255) * srgb_from_linear(std::clamp(linear, Real(0), Real(1)))));
}
[[nodiscard]] std::vector<std::uint8_t> srgb8_from_linear(std::span<const float> linear);

/// Where the codes of 8-bit sRGB begin, in linear light.
class SrgbCodes {
 public:
  static const SrgbCodes& table();

  [[nodiscard]] std::uint8_t of(float linear) const {
    const float light = linear > 0 ? std::min(linear, 1.0f) : 0;
    const std::size_t code = first_[std::size_t(light * kCells)];
    return std::uint8_t(code + (light >= begins_[code + 1] ? 1 : 0));
  }

 private:
  static constexpr std::size_t kCells = 4096;  // so many that none has two borders, not even near black
  SrgbCodes();

  std::array<float, 257> begins_{};               // the least light of each code, and more than there is
  std::array<std::uint8_t, kCells + 1> first_{};  // code of the least light of each cell, and of white
};

/// The same without a power. Not a number counts as black.
[[nodiscard]] inline std::uint8_t srgb8_from_linear(float linear) {
  return SrgbCodes::table().of(linear);
}

/// @param linear  [H, W] luminance or [H, W, 3] Rec.709, told apart by size.
[[nodiscard]] Picture picture_from_linear(int width, int height, std::span<const float> linear);

/// Linear Rec.709 of a colour at a luminance; chroma that leaves the gamut is reduced.
[[nodiscard]] inline Vec3f linear_rgb_at(float luminance, Ab color) {
  return gamut_mapped_linear_rgb_from_lab<float>({lightness_from_luminance(luminance), color.a, color.b});
}
/// Linear Rec.709, [N, 3], of planes of CIELAB; chroma that leaves the gamut is reduced.
/// @param lightness  [N] L* 0..100
/// @param ab         [2, N]; empty = grey
[[nodiscard]] std::vector<float> linear_rgb_from_lab(std::span<const float> lightness, std::span<const float> ab);

/// 8-bit sRGB, [N, 3], of CIELAB, on the calling thread; chroma that leaves the gamut is reduced.
/// @param lightness  [N] L* 0..100
/// @param a, b       [N]; empty = grey
/// @param gain       of the linear light
void srgb8_from_lab(std::span<const float> lightness, std::span<const float> a, std::span<const float> b, float gain,
                    std::span<std::uint8_t> rgb);

/// The picture, scaled down to `width` where it is wider.
[[nodiscard]] Picture scaled_down(const Picture& picture, int width);

}  // namespace cnerf
