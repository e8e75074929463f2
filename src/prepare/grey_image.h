#pragma once
/// Eight-bit grey pictures, by which frames are judged, features found and contact sheets drawn. OpenCV's
/// type, since all that is done with them is OpenCV's.

#include <opencv2/core.hpp>

#include "src/capture/image_io.h"

namespace cnerf::prepare {

/// sRGB codes of a luminance image times `gain`, clamped to 8 bits.
[[nodiscard]] cv::Mat1b grey_codes(const LinearImage& luminance, float gain = 1);

/// How sharp a picture is: the standard deviation of its Laplacian over that of its codes, at no more than 640 pixels
/// on the longer side. Does not change with exposure; grain raises it, so compare pictures of one camera only.
[[nodiscard]] double sharpness(const cv::Mat1b& picture);

/// Reduced by area averaging until the longer side is at most `longest`; the picture itself if it is.
[[nodiscard]] cv::Mat1b reduced_to(const cv::Mat1b& picture, int longest);

}  // namespace cnerf::prepare
