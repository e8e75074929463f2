#pragma once
/// Single-channel images at the depth they came in. No colour ever enters this type.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "src/capture/pixel_plane.h"

namespace cnerf {

/// How stored values encode linear luminance.
enum class Transfer {
  kSrgb,     ///< IEC 61966-2-1
  kLinear,   ///< value = luminance
  kGamma22,  ///< value = luminance^(1/2.2)
};

/// "srgb", "linear" or "gamma22", as options call it.  @throws UsageError.
[[nodiscard]] Transfer transfer_named(const std::string& name);

enum class PixelDepth { kU8, kU16, kF32 };

struct MonoImage {
  int width = 0, height = 0;
  PixelDepth depth = PixelDepth::kU8;
  Transfer transfer = Transfer::kSrgb;
  float exposure = 1;              ///< light of this picture over that of the others; `luminance` divides by it
  float haze = 0;                  ///< light that lies over this picture alone; `luminance` takes it off before
  PixelPlane<std::uint8_t> u8;     ///< [H, W] when depth is kU8, else empty
  PixelPlane<std::uint16_t> u16;   ///< [H, W] when depth is kU16, else empty
  PixelPlane<float> f32;           ///< [H, W] when depth is kF32, else empty; always linear
  PixelPlane<std::uint8_t> alpha;  ///< [H, W] coverage 0..255; empty = opaque. Values are premultiplied: over black.
  PixelPlane<std::uint8_t> mask;   ///< [H, W] 0 = ignore this pixel; empty = every pixel counts

  [[nodiscard]] std::size_t pixel_count() const { return std::size_t(width) * std::size_t(height); }
  /// Linear luminance Y at the exposure of the whole capture, 1 = white, composited over black.
  /// @param index  y * width + x
  [[nodiscard]] float luminance(std::size_t index) const { return evened(stored_luminance(index)); }
  /// The same as the picture was taken.
  [[nodiscard]] float stored_luminance(std::size_t index) const;
  /// Light as the whole capture has it, from light as this picture has it. Never below 0 where there is haze.
  [[nodiscard]] float evened(float light) const { return (haze > 0 ? std::max(0.0f, light - haze) : light) / exposure; }
  [[nodiscard]] float coverage(std::size_t index) const { return alpha.empty() ? 1.0f : float(alpha[index]) / 255.0f; }
  [[nodiscard]] bool valid(std::size_t index) const { return mask.empty() || mask[index] != 0; }
};

/// What its pixels take, in memory or in a file.
[[nodiscard]] std::size_t bytes_of(const MonoImage& image);

/// Linear luminance of every pixel.  [H, W]
[[nodiscard]] std::vector<float> luminance_plane(const MonoImage& image);

/// Linear light of an encoded value in [0, 1], and back.
[[nodiscard]] float decode_transfer(Transfer transfer, float value);
[[nodiscard]] float encode_transfer(Transfer transfer, float luminance);

}  // namespace cnerf
