#include "src/picture/curve_picture.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace cnerf {
namespace {

constexpr int kRim = 6;  // pixels that stay free, so that no line is cut
const cv::Scalar kPaper = cv::Scalar::all(250), kLevelColor = cv::Scalar::all(190), kInk(30, 90, 180);  // RGB

}  // namespace

Picture curve_picture(std::span<const double> values, std::optional<double> level, int width, int height) {
  Picture picture{width, height, std::vector<std::uint8_t>(std::size_t(3) * std::size_t(width) * std::size_t(height))};
  cv::Mat paper(height, width, CV_8UC3, picture.rgb.data());
  paper.setTo(kPaper);
  if (values.empty()) return picture;
  double least = std::ranges::min(values), most = std::ranges::max(values);
  if (level) least = std::min(least, *level), most = std::max(most, *level);
  const double span = most > least ? most - least : 1;
  const auto row = [&](double value) {
    return int(std::lround(height - 1 - kRim - (value - least) / span * (height - 1 - 2 * kRim)));
  };
  const double step = double(width - 1 - 2 * kRim) / double(std::max<std::size_t>(1, values.size() - 1));
  const auto point = [&](std::size_t i) {
    return cv::Point(int(std::lround(kRim + double(i) * step)), row(values[i]));
  };
  if (level) cv::line(paper, {0, row(*level)}, {width - 1, row(*level)}, kLevelColor);
  cv::circle(paper, point(0), 2, kInk, cv::FILLED, cv::LINE_AA);
  for (std::size_t i = 1; i < values.size(); ++i) {
    cv::line(paper, point(i - 1), point(i), kInk, 1, cv::LINE_AA);
    cv::circle(paper, point(i), 2, kInk, cv::FILLED, cv::LINE_AA);
  }
  return picture;
}

}  // namespace cnerf
