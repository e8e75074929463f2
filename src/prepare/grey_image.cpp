#include "src/prepare/grey_image.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/base/check.h"
#include "src/picture/picture.h"

namespace cnerf::prepare {

cv::Mat1b grey_codes(const LinearImage& luminance, float gain) {
  CNERF_CHECK_EQ(luminance.channels, 1);
  cv::Mat1b out(luminance.height, luminance.width);
  std::size_t i = 0;
  for (std::uint8_t& code : out) code = srgb8_from_linear(luminance.values[i++] * gain);
  return out;
}

double sharpness(const cv::Mat1b& picture) {
  cv::Mat laplacian;
  const cv::Mat1b small = reduced_to(picture, 640);
  cv::Laplacian(small, laplacian, CV_32F);
  cv::Scalar mean, edges, contrast;
  cv::meanStdDev(laplacian, mean, edges);
  cv::meanStdDev(small, mean, contrast);
  return contrast[0] > 0 ? edges[0] / contrast[0] : 0;
}

cv::Mat1b reduced_to(const cv::Mat1b& picture, int longest) {
  const int longer = std::max(picture.cols, picture.rows);
  if (longer <= longest) return picture;
  const double scale = double(longest) / longer;
  cv::Mat1b out;
  cv::resize(picture, out,
             {std::max(1, int(std::lround(picture.cols * scale))), std::max(1, int(std::lround(picture.rows * scale)))},
             0, 0, cv::INTER_AREA);
  return out;
}

}  // namespace cnerf::prepare
