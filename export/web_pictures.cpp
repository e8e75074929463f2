#include "export/web_pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "bake/volume/integrate.h"
#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/capture/mono_image.h"
#include "src/picture/encode.h"

namespace cnerf::exporting {
namespace {

constexpr int kPosterQuality = 80;

/// The camera for a picture whose longer side is `side` pixels at most.
Intrinsics fitted(const Intrinsics& intrinsics, int side) {
  const double scale = std::min(1.0, double(side) / std::max(intrinsics.width, intrinsics.height));
  return resized(intrinsics, std::max(1, int(std::lround(intrinsics.width * scale))),
                 std::max(1, int(std::lround(intrinsics.height * scale))));
}

/// For every pixel of the pinhole picture, where the lens put it; -1 where it did not.
void undistortion(const Intrinsics& lens, const Intrinsics& pinhole, cv::Mat& x, cv::Mat& y) {
  x.create(pinhole.height, pinhole.width, CV_32F);
  y.create(pinhole.height, pinhole.width, CV_32F);
  for (int row = 0; row < pinhole.height; ++row) {
    for (int column = 0; column < pinhole.width; ++column) {
      const auto seen = project(lens, ray_direction(pinhole, {column + 0.5, row + 0.5}));
      x.at<float>(row, column) = seen ? float(seen->x - 0.5) : -1.0f;  // OpenCV's pixel centres are whole
      y.at<float>(row, column) = seen ? float(seen->y - 0.5) : -1.0f;
    }
  }
}

}  // namespace

Intrinsics without_distortion(const Intrinsics& intrinsics) {
  Intrinsics pinhole = intrinsics;
  pinhole.model = LensModel::kPinhole;
  pinhole.distortion = {};
  return pinhole;
}

WebPhoto make_web_photo(const Intrinsics& intrinsics, const std::vector<float>& luminance, int side, int quality) {
  CNERF_CHECK_EQ(luminance.size(), std::size_t(intrinsics.width) * intrinsics.height);
  const cv::Mat linear(intrinsics.height, intrinsics.width, CV_32F, const_cast<float*>(luminance.data()));
  const Intrinsics small = fitted(intrinsics, side);
  cv::Mat scaled, shown;
  cv::resize(linear, scaled, {small.width, small.height}, 0, 0, cv::INTER_AREA);  // in linear light
  if (intrinsics.model == LensModel::kPinhole) {
    shown = scaled;
  } else {
    cv::Mat x, y;
    undistortion(small, without_distortion(small), x, y);
    cv::remap(scaled, shown, x, y, cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
  }
  cv::Mat grey(shown.rows, shown.cols, CV_8U);
  for (int row = 0; row < shown.rows; ++row) {
    for (int column = 0; column < shown.cols; ++column) {
      grey.at<std::uint8_t>(row, column) = srgb8_from_linear(shown.at<float>(row, column));
    }
  }
  return {jpeg_bytes(grey, quality), grey.cols, grey.rows};
}

std::vector<WebPhoto> make_web_photos(std::span<const View> views, int side, int quality) {
  std::vector<WebPhoto> photos(views.size());
  parallel_tasks(views.size(), [&](std::size_t i) {
    photos[i] = make_web_photo(views[i].intrinsics, luminance_plane(views[i].image), side, quality);
  });
  return photos;
}

std::vector<std::byte> make_poster(std::span<const bake::Volume> volumes, const bake::Camera& camera, int side) {
  const Intrinsics pinhole = without_distortion(fitted(camera.intrinsics, side));
  bake::IntegratorOptions options;
  options.step = 0.5;
  options.samples_per_axis = 1;
  const bake::VolumeImage image = integrate_volumes(volumes, pinhole, camera.world_from_camera, options);
  cv::Mat bgra(image.height, image.width, CV_8UC4);
  for (std::size_t i = 0; i < image.opacity.size(); ++i) {
    const float opacity = image.opacity[i];
    std::uint8_t* pixel = bgra.data + 4 * i;
    for (std::size_t c = 0; c < 3; ++c) {
      const float premultiplied = image.rgb[3 * i + c];
      pixel[2 - c] = srgb8_from_linear(opacity > 0 ? premultiplied / opacity : 0.0f);
    }
    pixel[3] = std::uint8_t(std::lround(255 * std::clamp(opacity, 0.0f, 1.0f)));
  }
  return webp_bytes(bgra, kPosterQuality);
}

}  // namespace cnerf::exporting
