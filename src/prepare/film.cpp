#include "src/prepare/film.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/base/statistics.h"
#include "src/color/colorspace_math.h"
#include "src/prepare/grey_image.h"

namespace cnerf::prepare {
namespace {

constexpr int kShortestShot = 5;
constexpr double kCutLikeness = 0.6, kCutDrop = 0.25;
constexpr double kDuplicateShare = 1.0 / 6, kDuplicateCodes = 1.5;
constexpr double kBorderChange = 3, kBorderSpread = 4;  ///< standard deviations in time and along the line, codes
constexpr int kWindow = 4;                              ///< frames on each side of running medians and means

double mean_linear(const cv::Mat1b& picture) {
  static const std::array<double, 256> linear = [] {
    std::array<double, 256> table{};
    for (std::size_t i = 0; i < table.size(); ++i) table[i] = linear_from_srgb(double(i) / 255);
    return table;
  }();
  double sum = 0;
  for (const std::uint8_t code : picture) sum += linear[code];
  return sum / double(picture.total());
}

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
  facts.brightness = mean_linear(small);
  facts.sharpness = sharpness(frame);
  facts.comb = comb_ratio(frame);
  facts.grain = grain_codes(frame);
  facts.scratched = has_scratch(frame);
  const cv::Mat1f blurred = normalised(small, {32, 24});
  cv::Mat1f whole;
  small.convertTo(whole, CV_32F);
  if (!small_before_.empty()) {
    facts.change = cv::norm(small, small_before_, cv::NORM_L1) / double(small.total());
    facts.likeness = blurred.dot(blurred_before_);
    if (window_.empty()) cv::createHanningWindow(window_, whole.size(), CV_32F);
    const double scale = double(frame.cols) / small.cols;
    facts.shift = cv::phaseCorrelate(shift_before_, whole, window_) * scale;
  }
  small_before_ = small.clone();
  blurred_before_ = blurred;
  shift_before_ = whole;
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

double grain_codes(const cv::Mat1b& frame) {
  static const cv::Matx33f mask(1, -2, 1, -2, 4, -2, 1, -2, 1);
  if (frame.cols < 3 || frame.rows < 3) return 0;
  cv::Mat response;
  cv::filter2D(frame, response, CV_32F, mask);
  const cv::Mat inner = response(cv::Rect(1, 1, frame.cols - 2, frame.rows - 2));
  return std::sqrt(CV_PI / 2) / 6 * cv::norm(inner, cv::NORM_L1) / double(inner.total());
}

bool has_scratch(const cv::Mat1b& frame) {
  constexpr int kReach = 4;         // columns on each side that a line is compared with
  constexpr double kContrast = 10;  // codes
  if (frame.cols < 4 * kReach) return false;
  cv::Mat1b level;  // grain averaged along the line, in 32 bands
  cv::resize(frame, level, {frame.cols, 32}, 0, 0, cv::INTER_AREA);
  for (int x = kReach; x < frame.cols - kReach; ++x) {
    int above = 0, below = 0;
    for (int y = 0; y < level.rows; ++y) {
      const int around = std::max(level(y, x - kReach), level(y, x + kReach));
      const int around_low = std::min(level(y, x - kReach), level(y, x + kReach));
      above += level(y, x) > around + kContrast ? 1 : 0;
      below += level(y, x) < around_low - kContrast ? 1 : 0;
    }
    if (std::max(above, below) >= int(0.8 * level.rows)) return true;
  }
  return false;
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

FilmMarks film_marks(const std::vector<FrameFacts>& frames, const Shot& shot) {
  FilmMarks out;
  std::vector<double> grain, ratios;
  std::vector<cv::Point2d> path;
  cv::Point2d at{};
  int scratched = 0;
  for (int i = shot.begin; i < shot.end; ++i) {
    const FrameFacts& frame = frames[std::size_t(i)];
    std::vector<double> around;
    for (int j = std::max(shot.begin, i - kWindow); j < std::min(shot.end, i + kWindow + 1); ++j) {
      around.push_back(frames[std::size_t(j)].brightness);
    }
    const double usual = median(around);
    if (usual > 0) ratios.push_back(frame.brightness / usual);
    grain.push_back(frame.grain);
    scratched += frame.scratched ? 1 : 0;
    if (i > shot.begin) at += frame.shift;
    path.push_back(at);
  }
  double squared = 0;
  for (const double ratio : ratios) squared += (ratio - 1) * (ratio - 1);
  out.flicker = ratios.empty() ? 0 : std::sqrt(squared / double(ratios.size()));
  double shaken = 0;
  int counted = 0;
  for (int i = kWindow; i + kWindow < int(path.size()); ++i, ++counted) {
    cv::Point2d mean{};
    for (int j = i - kWindow; j <= i + kWindow; ++j) mean += path[std::size_t(j)] / (2.0 * kWindow + 1);
    const cv::Point2d off = path[std::size_t(i)] - mean;
    shaken += off.dot(off);
  }
  out.weave = counted > 0 ? std::sqrt(shaken / counted) : 0;
  out.grain = grain.empty() ? 0 : median(grain);
  out.scratched = shot.size() > 0 ? double(scratched) / shot.size() : 0;
  return out;
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
