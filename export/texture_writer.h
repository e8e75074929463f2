#pragma once
/// Planes of floats -> OpenEXR, lossless; a baked texture -> PNG and OpenEXR.

#include <cstddef>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "bake/mesh.h"

namespace cnerf::exporting {

struct ExrChannel {
  std::string name;
  std::span<const float> values;  ///< value i of the channel is `values[i * stride]`; rows from the top
  std::size_t stride = 1;
  bool half = false;  ///< stored in 16 bits; values beyond their range are clamped
};

struct ExrImage {
  int width = 0, height = 0;
  std::vector<ExrChannel> channels;
  std::map<std::string, std::string> attributes;  ///< text, beside the standard ones
};

/// ZIP-compressed, with the chromaticities of Rec.709 and D65. The file is whole or not there.
/// @throws ContractError  on a value that is not finite, or sizes that disagree.
/// @throws OutputError    when the file cannot be written.
void write_exr(const std::filesystem::path& file, const ExrImage& image);

/// The base colour as glTF wants it: 8-bit sRGB PNG, clamped.
[[nodiscard]] std::vector<std::byte> basecolor_png(const bake::Texture& texture);

/// Names of the float textures beside each other.
struct TextureFiles {
  std::filesystem::path rgb;        ///< R G B half, linear Rec.709
  std::filesystem::path luminance;  ///< Y float, linear
  std::filesystem::path lab;        ///< L, a, b float: data, not colour
};

/// Writes `name`_rgb.exr, `name`_lum.exr and `name`_lab.exr. Grey texels have a = b = 0 exactly.
/// @param color_origin  see bake::color_origin_text.
/// @throws ContractError, OutputError  as write_exr.
TextureFiles write_exr_textures(const bake::Texture& texture, const std::string& color_origin,
                                const std::filesystem::path& folder, const std::string& name);

}  // namespace cnerf::exporting
