#include "src/colorizer/gallery.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr int kMargin = 4, kCaptionHeight = 16;
const cv::Scalar kBackground(32, 32, 32), kInk(220, 220, 220);

/// 8-bit BGR, out-of-gamut chroma reduced.
cv::Mat picture_of(const GalleryTile& tile) {
  const std::size_t pixels = std::size_t(tile.height) * std::size_t(tile.width);
  CNERF_CHECK_EQ(tile.lightness.size(), pixels);
  if (!tile.ab.empty()) CNERF_CHECK_EQ(tile.ab.size(), 2 * pixels);
  cv::Mat picture(tile.height, tile.width, CV_8UC3);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float a = tile.ab.empty() ? 0.0f : tile.ab[i], b = tile.ab.empty() ? 0.0f : tile.ab[pixels + i];
    const Vec3<float> rgb = gamut_mapped_linear_rgb_from_lab(Lab<float>{tile.lightness[i], a, b});
    for (int c = 0; c < 3; ++c) {
      picture.data[3 * i + std::size_t(2 - c)] =
          static_cast<unsigned char>(std::lround(255 * std::clamp(srgb_from_linear(rgb[c]), 0.0f, 1.0f)));
    }
  }
  return picture;
}

void write_caption(cv::Mat cell, const std::string& caption) {
  cv::putText(cell, caption, {1, cell.rows - 4}, cv::FONT_HERSHEY_PLAIN, 0.8, kInk, 1, cv::LINE_AA);
}

}  // namespace

void write_gallery(const std::filesystem::path& file, std::span<const GalleryTile> tiles, int columns) {
  CNERF_CHECK(columns > 0, std::to_string(columns));
  cv::Size cell{1, 1};
  int caption_height = 0;
  for (const GalleryTile& tile : tiles) {
    cell = {std::max(cell.width, tile.width), std::max(cell.height, tile.height)};
    if (!tile.caption.empty()) caption_height = kCaptionHeight;
  }
  const int count = std::max(1, int(tiles.size())), across = std::min(columns, count);
  const int down = (count + across - 1) / across;
  const cv::Size pitch{cell.width + kMargin, cell.height + caption_height + kMargin};
  cv::Mat sheet(down * pitch.height + kMargin, across * pitch.width + kMargin, CV_8UC3, kBackground);
  for (int i = 0; i < int(tiles.size()); ++i) {
    const GalleryTile& tile = tiles[std::size_t(i)];
    const cv::Point corner{kMargin + i % across * pitch.width, kMargin + i / across * pitch.height};
    if (tile.width > 0 && tile.height > 0) {
      picture_of(tile).copyTo(sheet(cv::Rect(corner.x, corner.y, tile.width, tile.height)));
    }
    if (!tile.caption.empty()) {
      write_caption(sheet(cv::Rect(corner.x, corner.y + cell.height, cell.width, caption_height)), tile.caption);
    }
  }
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", sheet, png)) throw OutputError(file.string() + ": the contact sheet could not be encoded");
  write_file(file, std::as_bytes(std::span(png)));
}

}  // namespace cnerf
