#pragma once
/// Codecs: pictures and films between files and memory, by OpenCV's modules imgcodecs and videoio. They bring hundreds
/// of libraries with them, so each is a plug-in that is loaded when it is first used. All throw DeviceError where the
/// plug-in is missing, and what OpenCV throws.

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace cv {
class VideoCapture;
class VideoWriter;
}  // namespace cv

namespace cnerf {

/// cv::imdecode.  @param flags  cv::IMREAD_…
[[nodiscard]] cv::Mat decode_image(const cv::Mat& bytes, int flags);
/// cv::imencode.  @param options  cv::IMWRITE_… and their values
/// @return  false: it could not
[[nodiscard]] bool encode_image(const std::string& extension, const cv::Mat& image, std::vector<std::uint8_t>& bytes,
                                const std::vector<int>& options = {});

/// @param api  cv::CAP_…
[[nodiscard]] std::shared_ptr<cv::VideoCapture> open_video(const std::string& file, int api);
/// An MPEG-4 file to write.
[[nodiscard]] std::shared_ptr<cv::VideoWriter> create_video(const std::string& file, int fps, cv::Size size);

/// What the plug-ins offer: libcnerf_images.so, libcnerf_videos.so.
struct ImageCodecs {
  cv::Mat (*decode)(const cv::Mat& bytes, int flags);
  bool (*encode)(const std::string& extension, const cv::Mat& image, std::vector<std::uint8_t>& bytes,
                 const std::vector<int>& options);
};
struct VideoCodecs {
  std::shared_ptr<cv::VideoCapture> (*open)(const std::string& file, int api);
  std::shared_ptr<cv::VideoWriter> (*create)(const std::string& file, int fps, cv::Size size);
};

}  // namespace cnerf
