#include "src/picture/codecs.h"

#include "src/base/plugin.h"

namespace cnerf {
namespace {

const ImageCodecs& images() {
  static const ImageCodecs& codecs = plugin_table<ImageCodecs>("images", "cnerf_image_codecs");
  return codecs;
}

const VideoCodecs& videos() {
  static const VideoCodecs& codecs = plugin_table<VideoCodecs>("videos", "cnerf_video_codecs");
  return codecs;
}

}  // namespace

cv::Mat decode_image(const cv::Mat& bytes, int flags) {
  return images().decode(bytes, flags);
}

bool encode_image(const std::string& extension, const cv::Mat& image, std::vector<std::uint8_t>& bytes,
                  const std::vector<int>& options) {
  return images().encode(extension, image, bytes, options);
}

std::shared_ptr<cv::VideoCapture> open_video(const std::string& file, int api) {
  return videos().open(file, api);
}

std::shared_ptr<cv::VideoWriter> create_video(const std::string& file, int fps, cv::Size size) {
  return videos().create(file, fps, size);
}

}  // namespace cnerf
