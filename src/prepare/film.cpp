#include "src/prepare/film.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/statistics.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace {

constexpr int kShortestShot = 5;
constexpr double kCutLikeness = 0.6, kCutDrop = 0.25;
constexpr double kDuplicateShare = 1.0 / 6, kDuplicateCodes = 1.5;
constexpr double kBorderChange = 3, kBorderSpread = 4;  ///< standard deviations in time and along the line, codes

/// Mean 0, length 1: brightness and contrast do not count.
cv::Mat1f normalised(const cv::Mat1b& picture, cv::Size size) {
  cv::Mat1b small;
  cv::Mat1f out;
  cv::resize(picture, small, size, 0, 0, cv::INTER_AREA);
  small.convertTo(out, CV_32F);
  cv::GaussianBlur(out, out, {0, 0}, 1.5);
  out -= cv::mean(out)[0];
  const double norm = cv::norm(out);
  return norm > 0 ? cv::Mat1f(out / norm) : out;
}

}  // namespace

FrameFacts FrameObserver::measure(const cv::Mat1b& frame) {
  FrameFacts facts;
  const cv::Mat1b small = reduced_to(frame, 320);
  facts.sharpness = sharpness(frame);
  facts.comb = comb_ratio(frame);
  const cv::Mat1f blurred = normalised(small, {32, 24});
  if (!small_before_.empty()) {
    facts.change = cv::norm(small, small_before_, cv::NORM_L1) / double(small.total());
    facts.likeness = blurred.dot(blurred_before_);
  }
  small_before_ = small.clone();
  blurred_before_ = blurred;
  return facts;
}

std::vector<Shot> find_shots(const std::vector<FrameFacts>& frames) {
  std::vector<Shot> shots;
  int begin = 0;
  const int count = int(frames.size());
  const auto likeness = [&](int i) { return frames[std::size_t(std::clamp(i, 1, std::max(1, count - 1)))].likeness; };
  for (int i = 1; i <= count; ++i) {
    if (i < count) {
      const double around = median(std::vector{likeness(i - 3), likeness(i - 2), likeness(i + 2), likeness(i + 3)});
      const double here = frames[std::size_t(i)].likeness;
      if (here > kCutLikeness || here > around - kCutDrop) continue;
    }
    if (i - begin >= kShortestShot) shots.push_back({begin, i});
    begin = i;
  }
  return shots;
}

std::vector<bool> find_duplicates(const std::vector<FrameFacts>& frames, const Shot& shot) {
  std::vector<bool> out(frames.size());
  std::vector<double> changes;
  for (int i = shot.begin + 1; i < shot.end; ++i) changes.push_back(frames[std::size_t(i)].change);
  const double usual = changes.empty() ? 0 : median(changes);
  for (int i = shot.begin + 1; i < shot.end; ++i) {
    const double change = frames[std::size_t(i)].change;
    out[std::size_t(i)] = change < kDuplicateShare * usual && change < kDuplicateCodes;
  }
  return out;
}

double comb_ratio(const cv::Mat1b& frame) {
  if (frame.rows < 8) return 0;
  const auto difference = [&](int rows) {
    return cv::norm(frame.rowRange(0, frame.rows - rows), frame.rowRange(rows, frame.rows), cv::NORM_L1) /
           double(frame.rows - rows);
  };
  const double next_but_one = difference(2);
  return next_but_one > 0 ? difference(1) / next_but_one : 0;
}

void BorderFinder::add(const cv::Mat1b& frame) {
  cv::Mat1f values;
  frame.convertTo(values, CV_32F);
  if (sum_.empty()) {
    sum_ = cv::Mat1f::zeros(frame.size());
    squares_ = cv::Mat1f::zeros(frame.size());
  }
  sum_ += values;
  squares_ += values.mul(values);
  ++count_;
}

cv::Rect BorderFinder::picture() const {
  CNERF_CHECK(count_ > 0, "borders are looked for in frames");
  const cv::Mat1f mean = sum_ / count_;
  cv::Mat1f variance = squares_ / count_ - mean.mul(mean);
  const auto is_border = [&](const cv::Rect& line) {
    cv::Scalar level, spread;
    cv::meanStdDev(mean(line), level, spread);
    return spread[0] < kBorderSpread && cv::mean(variance(line))[0] < kBorderChange * kBorderChange;
  };
  const int columns = mean.cols, rows = mean.rows;
  int top = 0, bottom = rows, left = 0, right = columns;
  while (top < rows && is_border({0, top, columns, 1})) ++top;
  while (bottom > top && is_border({0, bottom - 1, columns, 1})) --bottom;
  const int height = std::max(1, bottom - top);
  while (left < columns && is_border({left, std::min(top, rows - 1), 1, height})) ++left;
  while (right > left && is_border({right - 1, std::min(top, rows - 1), 1, height})) --right;
  // The rows beside a bar are mixed with it by compression.
  constexpr int kMixed = 2;
  if (top > 0) top += kMixed;
  if (bottom < rows) bottom -= kMixed;
  if (left > 0) left += kMixed;
  if (right < columns) right -= kMixed;
  const bool is_plausible = right - left > columns / 2 && bottom - top > rows / 2;
  return is_plausible ? cv::Rect(left, top, right - left, bottom - top) : cv::Rect(0, 0, columns, rows);
}

std::vector<int> choose_frames(const std::vector<FrameFacts>& frames, const Shot& shot,
                               const std::vector<bool>& left_out, int count) {
  std::vector<int> chosen;
  const int windows = std::min(count, shot.size());
  for (int window = 0; window < windows; ++window) {
    const int begin = shot.begin + int(std::int64_t(shot.size()) * window / windows);
    const int end = shot.begin + int(std::int64_t(shot.size()) * (window + 1) / windows);
    int best = -1;
    for (int i = begin; i < end; ++i) {
      if (left_out[std::size_t(i)]) continue;
      if (best < 0 || frames[std::size_t(i)].sharpness > frames[std::size_t(best)].sharpness) best = i;
    }
    if (best >= 0) chosen.push_back(best);
  }
  return chosen;
}

}  // namespace cnerf::prepare
