#include "export/web_pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "bake/volume/integrate.h"
#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/capture/mono_image.h"
#include "src/picture/encode.h"
#include "src/picture/picture.h"

namespace cnerf::exporting {
namespace {

constexpr int kPosterQuality = 80;

/// The camera for a picture whose longer side is `side` pixels at most.
Intrinsics fitted(const Intrinsics& intrinsics, int side) {
  const double scale = std::min(1.0, double(side) / std::max(intrinsics.width, intrinsics.height));
  return resized(intrinsics, std::max(1, int(std::lround(intrinsics.width * scale))),
                 std::max(1, int(std::lround(intrinsics.height * scale))));
}

/// How photographs of a lens become pictures of a pinhole camera: views mostly share it.
struct PhotoLens {
  Intrinsics lens;
  Intrinsics shown;  ///< the lens at the picture's size
  cv::Mat x, y;      ///< of every pixel of the picture, where the lens put it; -1 where it did not; empty of a pinhole
};

PhotoLens photo_lens(const Intrinsics& lens, int side) {
  PhotoLens photo{lens, fitted(lens, side), {}, {}};
  if (lens.model == LensModel::kPinhole) return photo;
  const Intrinsics pinhole = without_distortion(photo.shown);
  photo.x.create(pinhole.height, pinhole.width, CV_32F);
  photo.y.create(pinhole.height, pinhole.width, CV_32F);
  parallel_tasks(std::size_t(pinhole.height), [&](std::size_t row) {
    for (int column = 0; column < pinhole.width; ++column) {
      const auto seen = project(photo.shown, ray_direction(pinhole, {column + 0.5, double(row) + 0.5}));
      photo.x.at<float>(int(row), column) = seen ? float(seen->x - 0.5) : -1.0f;  // OpenCV's pixel centres are whole
      photo.y.at<float>(int(row), column) = seen ? float(seen->y - 0.5) : -1.0f;
    }
  });
  return photo;
}

WebPhoto web_photo(const PhotoLens& lens, const std::vector<float>& luminance, int quality) {
  CNERF_CHECK_EQ(luminance.size(), std::size_t(lens.lens.width) * std::size_t(lens.lens.height));
  const cv::Mat linear(lens.lens.height, lens.lens.width, CV_32F, const_cast<float*>(luminance.data()));
  cv::Mat shown;
  cv::resize(linear, shown, {lens.shown.width, lens.shown.height}, 0, 0, cv::INTER_AREA);  // in linear light
  if (!lens.x.empty()) {
    cv::Mat undistorted;
    cv::remap(shown, undistorted, lens.x, lens.y, cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
    shown = undistorted;
  }
  std::vector<std::uint8_t> codes = srgb8_from_linear({shown.ptr<float>(), shown.total()});
  return {jpeg_bytes(cv::Mat(shown.rows, shown.cols, CV_8U, codes.data()), quality), shown.cols, shown.rows};
}

}  // namespace

Intrinsics without_distortion(const Intrinsics& intrinsics) {
  Intrinsics pinhole = intrinsics;
  pinhole.model = LensModel::kPinhole;
  pinhole.distortion = {};
  return pinhole;
}

std::vector<WebPhoto> make_web_photos(std::span<const View> views, int side, int quality) {
  std::vector<std::pair<Intrinsics, std::vector<std::size_t>>> lenses;  // and the views of each
  for (std::size_t i = 0; i < views.size(); ++i) {
    auto known = std::ranges::find(lenses, views[i].intrinsics, [](const auto& lens) { return lens.first; });
    if (known == lenses.end()) known = lenses.insert(known, {views[i].intrinsics, {}});
    known->second.push_back(i);
  }
  std::vector<WebPhoto> photos(views.size());
  parallel_tasks(lenses.size(), [&](std::size_t l) {
    const PhotoLens lens = photo_lens(lenses[l].first, side);
    const std::vector<std::size_t>& of_lens = lenses[l].second;
    parallel_tasks(of_lens.size(), [&](std::size_t i) {
      photos[of_lens[i]] = web_photo(lens, luminance_plane(views[of_lens[i]].image), quality);
    });
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
