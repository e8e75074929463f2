// libcnerf_videos.so: OpenCV's videoio.

#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>

#include "src/picture/codecs.h"

namespace {

/// What fails is said by this program, once; OpenCV and FFmpeg would say it by the line on the terminal.
void silence() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const cnerf::VideoCodecs* cnerf_video_codecs() {
  static const cnerf::VideoCodecs codecs{[](const std::string& file, int api) {
                                           silence();
                                           return std::make_shared<cv::VideoCapture>(file, api);
                                         },
                                         [](const std::string& file, int fps, cv::Size size) {
                                           silence();
                                           return std::make_shared<cv::VideoWriter>(
                                               file, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), fps, size);
                                         }};
  return &codecs;
}
