#include "src/prepare/grey_image.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"

namespace cnerf {

cv::Mat1b grey_codes(const LinearImage& luminance, float gain) {
  CNERF_CHECK_EQ(luminance.channels, 1);
  cv::Mat1b out(luminance.height, luminance.width);
  std::size_t i = 0;
  for (std::uint8_t& code : out) {
    const float encoded = srgb_from_linear(std::clamp(luminance.values[i++] * gain, 0.0f, 1.0f));
    code = std::uint8_t(std::lround(encoded * 255));
  }
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

void write_png(const std::filesystem::path& file, const cv::Mat& picture) {
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", picture, bytes)) throw OutputError(file.string() + ": cannot be encoded");
  write_file(file, std::as_bytes(std::span(bytes)));
}

}  // namespace cnerf
