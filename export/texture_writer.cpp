#include "export/texture_writer.h"

#include <algorithm>
#include <cmath>

#include "src/base/check.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"
#include "src/picture/exr_writer.h"

namespace cnerf::exporting {
namespace {

std::vector<float> lightness_of(const std::vector<float>& luminance) {
  std::vector<float> lightness;
  for (const float y : luminance) lightness.push_back(lightness_from_luminance(y));
  return lightness;
}

}  // namespace

std::vector<std::byte> basecolor_png(const bake::Texture& texture) {
  const std::span<const float> rgb(&texture.rgb[0].x, 3 * texture.rgb.size());
  CNERF_CHECK(std::ranges::all_of(rgb, [](float value) { return std::isfinite(value); }),
              "a texture holds a value that is not finite");
  return png_bytes(picture_from_linear(texture.size, texture.size, rgb), PngEffort::kBytes);
}

TextureFiles write_exr_textures(const bake::Texture& texture, const std::string& color_origin,
                                const std::filesystem::path& folder, const std::string& name) {
  TextureFiles files{folder / (name + "_rgb.exr"), folder / (name + "_lum.exr"), folder / (name + "_lab.exr")};
  const std::span<const float> rgb(&texture.rgb[0].x, 3 * texture.rgb.size());
  const std::vector<float> lightness = lightness_of(texture.luminance);
  const auto write = [&](const std::filesystem::path& file, const char* space, std::vector<ExrChannel> channels) {
    write_exr(file, {texture.size,
                     texture.size,
                     std::move(channels),
                     {{"software", "cnerf " CNERF_VERSION}, {"colorOrigin", color_origin}, {"colorSpace", space}}});
  };
  write(files.rgb, "lin_rec709", {{"R", rgb, 3, true}, {"G", rgb.subspan(1), 3, true}, {"B", rgb.subspan(2), 3, true}});
  write(files.luminance, "linear luminance, Rec.709 Y", {{"Y", texture.luminance}});
  write(files.lab, "CIE 1976 L*a*b*, D65, 2 degrees; data, not colour",
        {{"Lab.L", lightness}, {"Lab.a", texture.a}, {"Lab.b", texture.b}});
  return files;
}

}  // namespace cnerf::exporting
