#include "src/picture/contact_sheet.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"

namespace cnerf {
namespace {

constexpr int kMargin = 4, kCaptionHeight = 16;  // pixels, of a grid of tiles
constexpr int kGap = 6;                          // pixels between the cells of a table
constexpr int kTitleHeight = 28;                 // pixels of the line with a table's titles

Picture blank(int width, int height, std::uint8_t grey) {
  return {width, height, std::vector<std::uint8_t>(std::size_t(3) * std::size_t(width) * std::size_t(height), grey)};
}

cv::Mat mat_of(const Picture& picture) {
  return {picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data())};
}

void paste(const Picture& picture, Picture& sheet, int left, int top) {
  if (picture.width == 0 || picture.height == 0) return;
  mat_of(picture).copyTo(mat_of(sheet)(cv::Rect(left, top, picture.width, picture.height)));
}

/// In the line that begins at `top`.
void write_title(const std::string& title, int left, int top, Picture& sheet) {
  cv::putText(mat_of(sheet), title, {left + 2, top + kTitleHeight - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.55,
              cv::Scalar(40, 40, 40), 1, cv::LINE_AA);
}

}  // namespace

Picture tiled(std::span<const Tile> tiles, int columns) {
  CNERF_CHECK(columns > 0, std::to_string(columns));
  cv::Size cell{1, 1};
  int caption_height = 0;
  for (const auto& [picture, caption] : tiles) {
    cell = {std::max(cell.width, picture.width), std::max(cell.height, picture.height)};
    if (!caption.empty()) caption_height = kCaptionHeight;
  }
  const int count = std::max(1, int(tiles.size())), across = std::min(columns, count);
  const int down = (count + across - 1) / across;
  const cv::Size pitch{cell.width + kMargin, cell.height + caption_height + kMargin};
  Picture sheet = blank(across * pitch.width + kMargin, down * pitch.height + kMargin, kSheetBackground);
  for (int i = 0; i < int(tiles.size()); ++i) {
    const auto& [picture, caption] = tiles[std::size_t(i)];
    const int left = kMargin + i % across * pitch.width, top = kMargin + i / across * pitch.height;
    paste(picture, sheet, left, top);
    if (caption.empty()) continue;
    cv::putText(mat_of(sheet)(cv::Rect(left, top + cell.height, cell.width, caption_height)), caption,
                {1, caption_height - 4}, cv::FONT_HERSHEY_PLAIN, 0.8, cv::Scalar::all(220), 1, cv::LINE_AA);
  }
  return sheet;
}

ContactSheet::ContactSheet(std::vector<std::string> titles, int cell_width)
    : titles_(std::move(titles)), cell_width_(cell_width) {}

void ContactSheet::add_row(const std::vector<Picture>& pictures) {
  CNERF_CHECK_EQ(pictures.size(), titles_.size());
  std::vector<Picture> row;
  for (const Picture& picture : pictures) row.push_back(scaled_down(picture, cell_width_));
  rows_.push_back(std::move(row));
}

Picture ContactSheet::compose() const {
  std::vector<std::size_t> columns;
  std::vector<int> left;
  int width = kGap, height = kTitleHeight + kGap;
  for (std::size_t column = 0; column < titles_.size(); ++column) {
    int widest = 0;
    for (const auto& row : rows_) widest = std::max(widest, row[column].width);
    if (widest == 0) continue;
    columns.push_back(column);
    left.push_back(width);
    width += widest + kGap;
  }
  std::vector<int> top;
  for (const auto& row : rows_) {
    int tallest = 0;
    for (const Picture& picture : row) tallest = std::max(tallest, picture.height);
    top.push_back(height);
    height += tallest + kGap;
  }

  const int table_height = height;
  int right = kGap;
  for (const auto& [picture, caption] : below_) {
    right += picture.width + kGap;
    height = std::max(height, table_height + kTitleHeight + picture.height + kGap);
  }
  width = std::max(width, right);

  Picture sheet = blank(width, height, 255);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    write_title(titles_[columns[c]], left[c], 0, sheet);
    for (std::size_t r = 0; r < rows_.size(); ++r) paste(rows_[r][columns[c]], sheet, left[c], top[r]);
  }
  int next = kGap;
  for (const auto& [picture, caption] : below_) {
    write_title(caption, next, table_height, sheet);
    paste(picture, sheet, next, table_height + kTitleHeight);
    next += picture.width + kGap;
  }
  return sheet;
}

}  // namespace cnerf
