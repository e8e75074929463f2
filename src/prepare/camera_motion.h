#pragma once
/// Motion of a camera between two pictures, judged by tracked places: a camera that only turns or zooms sees no
/// parallax, and no amount of such pictures tells depth.

#include <opencv2/core.hpp>
#include <vector>

namespace cnerf::prepare {

enum class Motion {
  kStill,     ///< nothing moved to speak of
  kTurned,    ///< a turn on the spot, with or without zoom, explains what moved (so does a flat subject far away)
  kParallax,  ///< near and far things moved apart
};

struct MotionVerdict {
  Motion motion = Motion::kStill;
  double moved = 0;      ///< median displacement, share of the picture's diagonal
  double explained = 0;  ///< share of the places that the best turn puts within 1/250 of the diagonal, or two pixels
};

/// @param before, after  the same places in both pictures, pixels; at least 12
/// @param picture        size of both
[[nodiscard]] MotionVerdict judge_motion(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after,
                                         cv::Size picture);

}  // namespace cnerf::prepare
