// libcnerf_images.so: OpenCV's imgcodecs.

#include <opencv2/imgcodecs.hpp>

#include "src/picture/codecs.h"

extern "C" __attribute__((visibility("default"))) const cnerf::ImageCodecs* cnerf_image_codecs() {
  static const cnerf::ImageCodecs codecs{
      [](const cv::Mat& bytes, int flags) { return cv::imdecode(bytes, flags); },
      [](const std::string& extension, const cv::Mat& image, std::vector<std::uint8_t>& bytes,
         const std::vector<int>& options) { return cv::imencode(extension, image, bytes, options); }};
  return &codecs;
}
