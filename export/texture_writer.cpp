#include "export/texture_writer.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "export/exr_writer.h"
#include "src/base/check.h"
#include "src/color/colorspace_math.h"
#include "src/picture/encode.h"

namespace cnerf::exporting {
namespace {

std::map<std::string, std::string> attributes(const std::string& color_origin, const std::string& colorspace) {
  return {{"software", "cnerf " CNERF_VERSION}, {"colorOrigin", color_origin}, {"colorSpace", colorspace}};
}

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
                                const std::filesystem::path& folder, const std::string& name,
                                const ExrOptions& options) {
  const TextureFiles files{folder / (name + "_rgb.exr"), folder / (name + "_lum.exr"), folder / (name + "_lab.exr")};
  const int size = texture.size;
  const std::span<const float> rgb(&texture.rgb[0].x, 3 * texture.rgb.size());
  write_exr(files.rgb,
            {size,
             size,
             {{"R", rgb, 3, true}, {"G", rgb.subspan(1), 3, true}, {"B", rgb.subspan(2), 3, true}},
             attributes(color_origin, "lin_rec709")},
            options.mip);
  write_exr(files.luminance,
            {size, size, {{"Y", texture.luminance}}, attributes(color_origin, "linear luminance, Rec.709 Y")},
            options.mip);
  const std::vector<float> lightness = lightness_of(texture.luminance);
  write_exr(files.lab,
            {size,
             size,
             {{"Lab.L", lightness}, {"Lab.a", texture.a}, {"Lab.b", texture.b}},
             attributes(color_origin, "CIE 1976 L*a*b*, D65, 2 degrees; data, not colour")},
            options.mip);
  return files;
}

}  // namespace cnerf::exporting
