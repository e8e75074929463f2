#pragma once
/// Analysis of the frames of a clip: cuts, repeated frames, interlacing, borders, and the marks of old film. Works on
/// 8-bit grey frames; times are frame numbers.

#include <opencv2/core.hpp>
#include <vector>

namespace cnerf::prepare {

/// What is kept of every frame.
struct FrameFacts {
  double brightness = 0;   ///< mean linear luminance
  double sharpness = 0;    ///< see grey_image.h
  double change = 0;       ///< mean absolute difference to the frame before, codes
  double likeness = 1;     ///< correlation of its blurred, normalised picture with that of the frame before
  double comb = 0;         ///< see comb_ratio
  double grain = 0;        ///< see grain_codes
  cv::Point2d shift{};     ///< of the picture since the frame before, pixels
  bool scratched = false;  ///< see has_scratch
};

/// Looks at frames one after another.
class FrameObserver {
 public:
  [[nodiscard]] FrameFacts measure(const cv::Mat1b& frame);

 private:
  cv::Mat1b small_before_;
  cv::Mat1f blurred_before_, window_;
  cv::Mat1f shift_before_;
};

/// A range of frames without a cut: [begin, end).
struct Shot {
  int begin = 0, end = 0;
  [[nodiscard]] int size() const { return end - begin; }
};

/// Cuts lie where a frame does not resemble the one before, and its neighbours do theirs: a jolt of the camera lowers
/// several likenesses, a cut one. Shots of fewer than 5 frames are dropped.
[[nodiscard]] std::vector<Shot> find_shots(const std::vector<FrameFacts>& frames);

/// True for frames of a shot that repeat the one before: they differ by less than a sixth of what is usual there.
[[nodiscard]] std::vector<bool> find_duplicates(const std::vector<FrameFacts>& frames, const Shot& shot);

/// How much more neighbouring rows differ than next-neighbouring ones: below 1 in a whole picture, above where two
/// moments are woven together.
[[nodiscard]] double comb_ratio(const cv::Mat1b& frame);

/// Standard deviation of the noise, codes (Immerkaer 1996); fine texture counts as noise, so this is an upper bound.
[[nodiscard]] double grain_codes(const cv::Mat1b& frame);

/// A bright or dark line one to three pixels wide through at least 80 % of the rows.
[[nodiscard]] bool has_scratch(const cv::Mat1b& frame);

/// Collects what never changes at the edges.
class BorderFinder {
 public:
  void add(const cv::Mat1b& frame);
  /// The picture without bars that are uniform and unchanged throughout; all of it where there are none, or where less
  /// than a quarter would be left.
  [[nodiscard]] cv::Rect picture() const;
  [[nodiscard]] cv::Size size() const { return sum_.size(); }

 private:
  cv::Mat1f sum_, squares_;
  int count_ = 0;
};

/// The marks of old film in a shot.
struct FilmMarks {
  double flicker = 0;    ///< relative standard deviation of brightness around its running median
  double weave = 0;      ///< root mean square of the picture's shaking around its smoothed path, pixels
  double grain = 0;      ///< median, codes
  double scratched = 0;  ///< share of frames
};
[[nodiscard]] FilmMarks film_marks(const std::vector<FrameFacts>& frames, const Shot& shot);

/// From each of `count` equal windows of the shot the sharpest frame that is not left out. Sorted; fewer where a window
/// has none.
[[nodiscard]] std::vector<int> choose_frames(const std::vector<FrameFacts>& frames, const Shot& shot,
                                             const std::vector<bool>& left_out, int count);

}  // namespace cnerf::prepare
