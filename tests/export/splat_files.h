#pragma once
/// Readers of the files that splats are written to, for tests: PLY by its header, SPZ by its description.

#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/base/files.h"
#include "src/base/gzip.h"
#include "tests/bake/splat/reference_rasterizer.h"

namespace cnerf::exporting::test {

using bake::test::FileSplat;

/// Binary, all properties floats.
inline std::vector<FileSplat> read_splat_ply(const std::filesystem::path& file) {
  const std::string text = read_text_file(file);
  const std::string last = "end_header\n";
  const std::size_t begin = text.find(last) + last.size();
  std::istringstream header(text.substr(0, begin));
  std::map<std::string, std::size_t> places;
  std::size_t count = 0;
  for (std::string line; std::getline(header, line);) {
    std::istringstream words(line);
    std::string first, second, third;
    words >> first >> second >> third;
    if (first == "element") count = std::stoul(third);
    if (first == "property") places.emplace(third, places.size());
  }
  std::vector<float> values((text.size() - begin) / sizeof(float));
  std::memcpy(values.data(), text.data() + begin, values.size() * sizeof(float));
  if (values.size() != count * places.size()) throw std::runtime_error("the PLY's size is not its header's");
  std::vector<FileSplat> splats(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = [&](const std::string& name) { return double(values[i * places.size() + places.at(name)]); };
    FileSplat& splat = splats[i];
    splat.position = {at("x"), at("y"), at("z")};
    splat.opacity_logit = at("opacity");
    for (int axis = 0; axis < 3; ++axis) splat.log_scale[axis] = at("scale_" + std::to_string(axis));
    for (std::size_t k = 0; k < 4; ++k) splat.rotation[k] = at("rot_" + std::to_string(k));
    for (int c = 0; c < 3; ++c) {
      splat.harmonics[0][c] = at("f_dc_" + std::to_string(c));
      for (int k = 0; k < 8; ++k) splat.harmonics[std::size_t(k) + 1][c] = at("f_rest_" + std::to_string(8 * c + k));
    }
  }
  return splats;
}

/// Version 3, degree 2.
inline std::vector<FileSplat> read_splat_spz(const std::filesystem::path& file) {
  const auto unpacked = gunzip(read_binary_file(file), std::size_t(1) << 30);
  if (!unpacked) throw std::runtime_error("the SPZ is no gzip file");
  const std::vector<std::uint8_t>& bytes = *unpacked;
  const auto word = [&](std::size_t at) {
    return bytes[at] | unsigned(bytes[at + 1]) << 8 | unsigned(bytes[at + 2]) << 16 | unsigned(bytes[at + 3]) << 24;
  };
  const std::size_t n = word(8);
  if (word(0) != 0x5053474e || word(4) != 3 || bytes[12] != 2 || bytes.size() != 16 + n * (9 + 1 + 3 + 3 + 4 + 24)) {
    throw std::runtime_error("the SPZ's header is not as expected");
  }
  const std::size_t alphas = 16 + 9 * n, colors = alphas + n, scales = colors + 3 * n, turns = scales + 3 * n,
                    harmonics = turns + 4 * n;
  std::vector<FileSplat> splats(n);
  for (std::size_t i = 0; i < n; ++i) {
    FileSplat& splat = splats[i];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = 16 + 9 * i + 3 * c;
      std::int32_t whole = bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16;
      if (whole >= 1 << 23) whole -= 1 << 24;
      splat.position[int(c)] = std::ldexp(double(whole), -int(bytes[13]));
      splat.harmonics[0][int(c)] = (bytes[colors + 3 * i + c] / 255.0 - 0.5) / 0.15;
      splat.log_scale[int(c)] = bytes[scales + 3 * i + c] / 16.0 - 10;
      for (std::size_t k = 0; k < 8; ++k) {
        splat.harmonics[k + 1][int(c)] = (bytes[harmonics + 24 * i + 3 * k + c] - 128.0) / 128;
      }
    }
    const double alpha = std::clamp(bytes[alphas + i] / 255.0, 1e-6, 1 - 1e-6);
    splat.opacity_logit = std::log(alpha / (1 - alpha));
    std::uint32_t packed = word(turns + 4 * i);
    const std::uint32_t largest = packed >> 30;
    std::array<double, 4> xyzw{};
    double squares = 0;
    for (int k = 3; k >= 0; --k) {
      if (std::uint32_t(k) == largest) continue;
      const double part = (packed & 511) / 511.0 * std::sqrt(0.5) * ((packed >> 9 & 1) != 0 ? -1 : 1);
      packed >>= 10;
      xyzw[std::size_t(k)] = part;
      squares += part * part;
    }
    xyzw[largest] = std::sqrt(std::max(0.0, 1 - squares));
    splat.rotation = {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
  }
  return splats;
}

}  // namespace cnerf::exporting::test
