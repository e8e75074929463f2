#pragma once
/// JPEG files with EXIF notes, as cameras write them.

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "tests/support/upright.h"

namespace cnerf::test {

/// A big-endian EXIF block with orientation, focal length and its 35 mm equivalent.
inline std::string exif_block(int orientation, int focal_mm = 26, int focal_35mm = 28) {
  std::string tiff("MM\0*\0\0\0\x08", 8);
  const auto u16 = [&](int v) { tiff += {char(v >> 8), char(v)}; };
  const auto u32 = [&](int v) { tiff += {char(v >> 24), char(v >> 16), char(v >> 8), char(v)}; };
  u16(2);  // entries of the first directory, at 8
  u16(0x0112), u16(3), u32(1), u16(orientation), u16(0);
  u16(0x8769), u16(4), u32(1), u32(38);  // the EXIF directory follows
  u32(0);
  u16(2);                                // at 38
  u16(0x920A), u16(5), u32(1), u32(68);  // focal length, a rational at 68
  u16(0xA405), u16(3), u32(1), u16(focal_35mm), u16(0);
  u32(0);
  u32(focal_mm), u32(1);
  return std::string("Exif\0\0", 6) + tiff;
}

/// A JPEG with the block inserted behind its first marker.
inline std::string jpeg_with(const std::string& exif, const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  EXPECT_TRUE(cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 100}));
  const std::size_t size = exif.size() + 2;
  std::string text(bytes.begin(), bytes.begin() + 2);
  text += {char(0xFF), char(0xE1), char(size >> 8), char(size)};
  text += exif;
  return text.append(bytes.begin() + 2, bytes.end());
}

/// A photograph as a camera stores it that was turned. Upright it has 40 x 20 pixels, red on the left and blue on the
/// right.
inline std::string turned_photograph(int orientation) {
  const bool is_sideways = orientation > 4;
  const Upright grid = {orientation, is_sideways ? 20 : 40, is_sideways ? 40 : 20};
  cv::Mat3b image(grid.stored_height, grid.stored_width);
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      const int at = int(grid.stored_index(x, y));
      const bool is_left = x < grid.width() / 2;
      image(at / grid.stored_width, at % grid.stored_width) =
          is_left ? cv::Vec3b(30, 30, 200) : cv::Vec3b(200, 30, 30);  // B G R
    }
  }
  return jpeg_with(exif_block(orientation), image);
}

}  // namespace cnerf::test
