#include "src/colorizer_training/rgb_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "src/base/check.h"
#include "src/base/files.h"

namespace cnerf {
namespace {

/// Weights of the source samples that one target sample averages.
struct Tap {
  int begin = 0;
  std::vector<float> weights;
};

/// The tent filter, as wide as a target sample when shrinking and as a source sample when growing.
std::vector<Tap> resize_taps(int source, int target) {
  const double scale = double(source) / target;
  const double radius = std::max(1.0, scale);
  std::vector<Tap> taps(static_cast<std::size_t>(target));
  for (int i = 0; i < target; ++i) {
    const double centre = (i + 0.5) * scale - 0.5;
    const int begin = std::max(0, int(std::ceil(centre - radius)));
    const int end = std::min(source - 1, int(std::floor(centre + radius)));
    Tap& tap = taps[std::size_t(i)];
    tap.begin = begin;
    double sum = 0;
    for (int j = begin; j <= end; ++j) sum += std::max(0.0, 1 - std::abs(j - centre) / radius) + 1e-9;
    for (int j = begin; j <= end; ++j) {
      tap.weights.push_back(float((std::max(0.0, 1 - std::abs(j - centre) / radius) + 1e-9) / sum));
    }
  }
  return taps;
}

/// Resizes the middle axis of [outer, source, inner].
std::vector<float> resize_axis(const std::vector<float>& in, int outer, int source, int inner, int target) {
  const std::vector<Tap> taps = resize_taps(source, target);
  std::vector<float> out(std::size_t(outer) * target * inner, 0.0f);
  for (int o = 0; o < outer; ++o) {
    for (int t = 0; t < target; ++t) {
      float* to = &out[(std::size_t(o) * target + t) * inner];
      const Tap& tap = taps[std::size_t(t)];
      for (std::size_t k = 0; k < tap.weights.size(); ++k) {
        const float* from = &in[(std::size_t(o) * source + tap.begin + k) * inner];
        for (int i = 0; i < inner; ++i) to[i] += tap.weights[k] * from[i];
      }
    }
  }
  return out;
}

constexpr std::uint32_t kPngPolynomial = 0xedb88320u;

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) ? kPngPolynomial : 0);
  }
  return ~crc;
}

void append_u32(std::vector<std::uint8_t>& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(std::uint8_t(value >> shift));
}

void append_chunk(std::vector<std::uint8_t>& png, std::string_view type, std::span<const std::uint8_t> data) {
  append_u32(png, std::uint32_t(data.size()));
  const std::size_t begin = png.size();
  png.insert(png.end(), type.begin(), type.end());
  png.insert(png.end(), data.begin(), data.end());
  append_u32(png, crc32(std::span(png).subspan(begin)));
}

/// A zlib stream of stored blocks (RFC 1950, 1951).
std::vector<std::uint8_t> stored_zlib(std::span<const std::uint8_t> data) {
  std::vector<std::uint8_t> out = {0x78, 0x01};
  constexpr std::size_t kBlock = 65535;
  for (std::size_t begin = 0; begin < data.size(); begin += kBlock) {
    const std::size_t size = std::min(kBlock, data.size() - begin);
    const std::size_t inverted = ~size;
    out.push_back(begin + size == data.size());
    for (const std::size_t word : {size, inverted}) {
      out.push_back(std::uint8_t(word));
      out.push_back(std::uint8_t(word >> 8));
    }
    out.insert(out.end(), data.begin() + std::ptrdiff_t(begin), data.begin() + std::ptrdiff_t(begin + size));
  }
  std::uint32_t a = 1, b = 0;  // Adler-32
  for (const std::uint8_t byte : data) {
    a = (a + byte) % 65521;
    b = (b + a) % 65521;
  }
  append_u32(out, (b << 16) | a);
  return out;
}

}  // namespace

RgbImage resize_image(const RgbImage& image, int width, int height) {
  CNERF_CHECK(image.width > 0 && image.height > 0 && width > 0 && height > 0, "images have pixels");
  if (image.width == width && image.height == height) return image;
  std::vector<float> values(image.rgb.begin(), image.rgb.end());
  values = resize_axis(values, 1, image.height, image.width * 3, height);
  values = resize_axis(values, height, image.width, 3, width);
  RgbImage out{width, height, std::vector<std::uint8_t>(values.size())};
  std::transform(values.begin(), values.end(), out.rgb.begin(),
                 [](float v) { return std::uint8_t(std::clamp(std::lround(v), 0l, 255l)); });
  return out;
}

RgbImage crop_image(const RgbImage& image, int x, int y, int width, int height) {
  CNERF_CHECK(x >= 0 && y >= 0 && x + width <= image.width && y + height <= image.height, "the crop lies inside");
  RgbImage out{width, height, {}};
  out.rgb.reserve(std::size_t(width) * height * 3);
  for (int row = y; row < y + height; ++row) {
    const auto begin = image.rgb.begin() + (std::ptrdiff_t(row) * image.width + x) * 3;
    out.rgb.insert(out.rgb.end(), begin, begin + std::ptrdiff_t(width) * 3);
  }
  return out;
}

void write_png(const std::filesystem::path& file, const RgbImage& image) {
  std::vector<std::uint8_t> rows;
  const std::size_t stride = std::size_t(image.width) * 3;
  for (std::size_t y = 0; y < std::size_t(image.height); ++y) {
    rows.push_back(0);  // no filter
    rows.insert(rows.end(), image.rgb.begin() + std::ptrdiff_t(y * stride),
                image.rgb.begin() + std::ptrdiff_t((y + 1) * stride));
  }
  std::vector<std::uint8_t> png = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  std::vector<std::uint8_t> header;
  append_u32(header, std::uint32_t(image.width));
  append_u32(header, std::uint32_t(image.height));
  header.insert(header.end(), {8, 2, 0, 0, 0});  // 8 bits, RGB
  append_chunk(png, "IHDR", header);
  append_chunk(png, "IDAT", stored_zlib(rows));
  append_chunk(png, "IEND", {});
  write_file(file, std::as_bytes(std::span(png)));
}

}  // namespace cnerf
