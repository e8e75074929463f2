#include "export/texture_writer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "src/base/check.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

std::uint8_t srgb_byte(float linear) {
  CNERF_CHECK(std::isfinite(linear), "a texture holds a value that is not finite");
  return std::uint8_t(std::lround(255 * srgb_from_linear(std::clamp(linear, 0.0f, 1.0f))));
}

std::map<std::string, std::string> attributes(const std::string& color_origin, const std::string& colorspace) {
  return {{"software", "cnerf " CNERF_VERSION}, {"colorOrigin", color_origin}, {"colorSpace", colorspace}};
}

std::vector<float> lightness_of(const std::vector<float>& luminance) {
  std::vector<float> lightness;
  for (const float y : luminance) lightness.push_back(lightness_from_luminance(y));
  return lightness;
}

}  // namespace

std::vector<std::byte> basecolor_png(const BakedTexture& texture) {
  cv::Mat bgr(texture.size, texture.size, CV_8UC3);
  for (std::size_t i = 0; i < texture.rgb.size(); ++i) {
    std::uint8_t* pixel = bgr.data + 3 * i;
    for (int channel = 0; channel < 3; ++channel) pixel[2 - channel] = srgb_byte(texture.rgb[i][channel]);
  }
  std::vector<std::uint8_t> png;
  CNERF_CHECK(cv::imencode(".png", bgr, png, {cv::IMWRITE_PNG_COMPRESSION, 9}), "OpenCV cannot write PNG");
  std::vector<std::byte> bytes(png.size());
  std::transform(png.begin(), png.end(), bytes.begin(), [](std::uint8_t b) { return static_cast<std::byte>(b); });
  return bytes;
}

TextureFiles write_exr_textures(const BakedTexture& texture, const std::string& color_origin,
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
  const bool plain = options.lab_names == "lab";
  const std::vector<float> lightness = lightness_of(texture.luminance);
  write_exr(files.lab,
            {size,
             size,
             {{plain ? "Lab.L" : "Lab.X", lightness},
              {plain ? "Lab.a" : "Lab.Y", texture.a},
              {plain ? "Lab.b" : "Lab.Z", texture.b}},
             attributes(color_origin, "CIE 1976 L*a*b*, D65, 2 degrees; data, not colour")},
            options.mip);
  return files;
}

}  // namespace cnerf
