#pragma once
/// What the benchmarks that compare pictures share: their command lines and their measure.

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "src/color/colorspace_math.h"
#include "src/train/scene.h"

namespace cnerf::bench {

/// sRGB of linear light, clamped to what can be shown.
inline double encoded(float linear) {
  return srgb_from_linear(std::clamp(linear, 0.0f, 1.0f));
}

/// Of the mean of `values` squared differences; at most 120.
inline double decibels(double squared, std::size_t values) {
  return -10 * std::log10(std::max(squared / double(std::max<std::size_t>(values, 1)), 1e-12));
}

/// The field over black, linear RGB; grey where it has no colour.  [H, W, 3]
inline std::vector<float> rgb_of(const RenderedImage& image) {
  if (!image.baked_rgb.empty()) return image.baked_rgb;
  std::vector<float> rgb;
  for (const float y : image.luminance) rgb.insert(rgb.end(), {y, y, y});
  return rgb;
}

/// `FILE... key=value...` behind the program's name.
struct Arguments {
  std::vector<std::string> files;
  std::map<std::string, int> options;
};
/// @param options  the known ones with their defaults.  @throws std::out_of_range, std::invalid_argument  on others.
inline Arguments parse_arguments(int argc, char** argv, std::map<std::string, int> options) {
  Arguments parsed{{}, std::move(options)};
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    if (equals == std::string::npos) {
      parsed.files.push_back(argument);
    } else {
      parsed.options.at(argument.substr(0, equals)) = std::stoi(argument.substr(equals + 1));
    }
  }
  return parsed;
}

}  // namespace cnerf::bench
