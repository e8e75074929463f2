#pragma once
/// The optional encoder as a judge of pictures in colour: how alike two sets of pictures look, never which colours they
/// should have.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace cnerf {

class PictureEncoder {
 public:
  static constexpr int kRegions = 4;  ///< along either side of a picture

  virtual ~PictureEncoder() = default;
  /// Mean features of the picture's regions, [16, D].
  /// @param rgb  [H, W, 3] 8-bit sRGB
  [[nodiscard]] virtual std::vector<float> regions(std::span<const std::uint8_t> rgb, int width, int height) const = 0;
};

/// Null where no encoder is installed (scripts/install_dependencies.sh --encoder).
/// @throws InputError   its files are damaged
/// @throws DeviceError  as make_colorizer
[[nodiscard]] std::unique_ptr<PictureEncoder> make_picture_encoder();

}  // namespace cnerf
