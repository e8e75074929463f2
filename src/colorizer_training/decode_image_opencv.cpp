#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "src/colorizer_training/rgb_image.h"

namespace cnerf {

std::optional<RgbImage> decode_image(std::span<const std::byte> content) {
  if (content.empty()) return std::nullopt;
  const cv::Mat bytes(1, int(content.size()), CV_8UC1, const_cast<std::byte*>(content.data()));
  cv::Mat image = cv::imdecode(bytes, cv::IMREAD_COLOR);
  if (image.empty()) return std::nullopt;
  cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  return RgbImage{image.cols, image.rows, {image.datastart, image.dataend}};
}

}  // namespace cnerf
