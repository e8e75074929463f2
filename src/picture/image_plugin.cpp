// libcnerf_images.so: OpenCV's imgcodecs.

#include <opencv2/imgcodecs.hpp>

#include "src/picture/codecs.h"

extern "C" __attribute__((visibility("default"))) const cnerf::ImageCodecs* cnerf_image_codecs() {
  static const cnerf::ImageCodecs codecs{
      [](const cv::Mat& bytes, int flags) { return cv::imdecode(bytes, flags); },
      [](const std::string& extension, const cv::Mat& image, std::vector<std::uint8_t>& bytes,
         const std::vector<int>& options) { return cv::imencode(extension, image, bytes, options); }};
  // The first look at any picture begins all codecs; here a shortage of memory has an answer.
  (void)cv::imdecode(cv::Mat1b(1, 16, std::uint8_t(0)), cv::IMREAD_UNCHANGED);
  return &codecs;
}
