#pragma once
/// A baked texture -> PNG and OpenEXR.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "bake/mesh.h"

namespace cnerf::exporting {

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
