#pragma once
/// Analysis of the frames of a clip: cuts, repeated frames, interlacing, borders. Works on 8-bit grey frames;
/// times are frame numbers.

#include <opencv2/core.hpp>
#include <vector>

namespace cnerf::prepare {

/// What is kept of every frame.
struct FrameFacts {
  double sharpness = 0;  ///< see grey_image.h
  double change = 0;     ///< mean absolute difference to the frame before, codes
  double likeness = 1;   ///< correlation of its blurred, normalised picture with that of the frame before
  double comb = 0;       ///< see comb_ratio
};

/// Looks at frames one after another.
class FrameObserver {
 public:
  [[nodiscard]] FrameFacts measure(const cv::Mat1b& frame);

 private:
  cv::Mat1b small_before_;
  cv::Mat1f blurred_before_;
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

/// From each of `count` equal windows of the shot the sharpest frame that is not left out. Sorted; fewer where a window
/// has none.
[[nodiscard]] std::vector<int> choose_frames(const std::vector<FrameFacts>& frames, const Shot& shot,
                                             const std::vector<bool>& left_out, int count);

}  // namespace cnerf::prepare
