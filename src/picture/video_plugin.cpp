// libcnerf_videos.so: OpenCV's videoio.

#include <opencv2/videoio.hpp>

#include "src/picture/codecs.h"

extern "C" __attribute__((visibility("default"))) const cnerf::VideoCodecs* cnerf_video_codecs() {
  static const cnerf::VideoCodecs codecs{
      [](const std::string& file, int api) { return std::make_shared<cv::VideoCapture>(file, api); },
      [](const std::string& file, int fps, cv::Size size) {
        return std::make_shared<cv::VideoWriter>(file, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), fps, size);
      }};
  return &codecs;
}
