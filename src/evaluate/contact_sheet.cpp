#include "src/evaluate/contact_sheet.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/evaluate/metrics.h"

namespace cnerf {
namespace {

constexpr int kGap = 6;           // pixels between cells
constexpr int kTitleHeight = 28;  // pixels of the line with the titles

cv::Mat mat_of(const Picture& picture) {
  return {picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data())};
}

Picture picture_of(const cv::Mat& mat) {
  CNERF_CHECK_EQ(mat.isContinuous(), true);
  return {mat.cols, mat.rows, {mat.data, mat.data + mat.total() * 3}};
}

}  // namespace

Picture picture_from_linear(int width, int height, const std::vector<float>& linear) {
  const std::size_t pixels = std::size_t(width) * std::size_t(height);
  std::vector<std::uint8_t> values = srgb8_from_linear(linear);
  if (values.size() == 3 * pixels) return {width, height, std::move(values)};
  CNERF_CHECK_EQ(values.size(), pixels);
  Picture picture{width, height, std::vector<std::uint8_t>(3 * pixels)};
  for (std::size_t i = 0; i < pixels; ++i) std::fill_n(picture.rgb.begin() + 3 * i, 3, values[i]);
  return picture;
}

Picture scaled_down(const Picture& picture, int width) {
  if (picture.width <= width) return picture;
  cv::Mat small;
  const int height = std::max(1, picture.height * width / picture.width);
  cv::resize(mat_of(picture), small, {width, height}, 0, 0, cv::INTER_AREA);
  return picture_of(small);
}

std::vector<std::byte> jpeg_bytes(const Picture& picture, int quality) {
  cv::Mat bgr;
  cv::cvtColor(mat_of(picture), bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> bytes;
  CNERF_CHECK(cv::imencode(".jpg", bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, quality}), "OpenCV encodes JPEG");
  const auto raw = std::as_bytes(std::span(bytes));
  return {raw.begin(), raw.end()};
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

  cv::Mat sheet(height, width, CV_8UC3, cv::Scalar(255, 255, 255));
  for (std::size_t c = 0; c < columns.size(); ++c) {
    cv::putText(sheet, titles_[columns[c]], {left[c] + 2, kTitleHeight - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.55,
                cv::Scalar(40, 40, 40), 1, cv::LINE_AA);
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      const Picture& picture = rows_[r][columns[c]];
      if (picture.width == 0) continue;
      mat_of(picture).copyTo(sheet(cv::Rect(left[c], top[r], picture.width, picture.height)));
    }
  }
  return picture_of(sheet);
}

void write_png(const std::filesystem::path& file, const Picture& picture) {
  cv::Mat bgr;
  cv::cvtColor(mat_of(picture), bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", bgr, bytes)) throw OutputError(file.string() + ": OpenCV could not encode a PNG");
  write_file(file, std::as_bytes(std::span(bytes)));
}

}  // namespace cnerf
