#include "src/colorizer/torch/reference_images.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "src/base/check.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/capture/exr_io.h"
#include "src/capture/image_io.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr double kLeastChroma = 1.0;      // mean |ab|; a scanned grey photograph has less
constexpr int kSmallestLevel = 64;        // short side, pixels
constexpr float kMostTransparent = 0.5f;  // alpha of what no colour is taken from, as of key frames
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

/// Linear RGB [H, W, 3] of any 8- or 16-bit or float image OpenCV reads, turned as its EXIF says. Without alpha:
/// OpenCV gives the one or the other.
cv::Mat read_linear_rgb(const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = read_binary_file(file);
  const cv::Mat raw(1, int(bytes.size()), CV_8U, const_cast<std::byte*>(bytes.data()));
  const cv::Mat image = cv::imdecode(raw, cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH);
  if (image.empty()) throw InputError(file, "", "not an image this program can read");
  const double scale = image.depth() == CV_8U ? 1 / 255.0 : image.depth() == CV_16U ? 1 / 65535.0 : 1.0;
  cv::Mat rgb;
  image.convertTo(rgb, CV_32F, scale);
  cv::cvtColor(rgb, rgb, cv::COLOR_BGR2RGB);
  if (image.depth() == CV_32F) return rgb;  // linear already
  parallel_tasks(std::size_t(rgb.rows), [&](std::size_t y) {
    auto* row = rgb.ptr<float>(int(y));
    std::transform(row, row + 3 * rgb.cols, row, linear_from_srgb<float>);
  });
  return rgb;
}

/// Linear RGB over black, and alpha.  [H, W, 4]
cv::Mat read_linear_rgba(const std::filesystem::path& file) {
  LinearImage stored = read_linear_image(file, Transfer::kSrgb);
  cv::Mat rgba;
  if (stored.alpha.empty() && !is_exr(file)) {
    stored = {};  // the memory is needed again
    cv::cvtColor(read_linear_rgb(file), rgba, cv::COLOR_RGB2RGBA);
    return rgba;
  }
  const cv::Size size(stored.width, stored.height);
  const cv::Mat pixels(size, CV_32FC(stored.channels), stored.values.data());
  cv::cvtColor(pixels, rgba, stored.channels == 1 ? cv::COLOR_GRAY2RGBA : cv::COLOR_RGB2RGBA);
  if (!stored.alpha.empty()) cv::insertChannel(cv::Mat(size, CV_32F, stored.alpha.data()), rgba, 3);
  return rgba;
}

LabImage lab_of(const cv::Mat& linear_rgba) {
  LabImage image{linear_rgba.cols, linear_rgba.rows, std::vector<float>(linear_rgba.total() * 3)};
  float* out = image.lab.data();
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x, out += 3) {
      const auto& pixel = linear_rgba.at<cv::Vec4f>(y, x);
      const Lab<float> lab = lab_from_linear_rgb(Vec3<float>{pixel[0], pixel[1], pixel[2]});
      out[0] = lab.lightness;
      const bool is_known = pixel[3] > kMostTransparent;
      out[1] = is_known ? lab.a : kUnknown;
      out[2] = is_known ? lab.b : kUnknown;
    }
  }
  return image;
}

ReferenceImage pyramid_of(cv::Mat linear_rgba) {
  const double shrink = double(kReferenceShortSide) / std::min(linear_rgba.cols, linear_rgba.rows);
  if (shrink < 1) cv::resize(linear_rgba, linear_rgba, {}, shrink, shrink, cv::INTER_AREA);
  ReferenceImage image;
  image.levels.push_back(lab_of(linear_rgba));
  while (std::min(linear_rgba.cols, linear_rgba.rows) >= 2 * kSmallestLevel) {
    cv::Mat half;
    cv::resize(linear_rgba, half, {linear_rgba.cols / 2, linear_rgba.rows / 2}, 0, 0, cv::INTER_AREA);
    linear_rgba = half;
    image.levels.push_back(lab_of(linear_rgba));
  }
  return image;
}

/// The level whose pixels are at least as fine as the patch's, but not twice as fine.
const LabImage& level_for(const ReferenceImage& image, double pixels_per_patch_pixel, double* level_scale) {
  std::size_t level = 0;
  *level_scale = 1;
  while (level + 1 < image.levels.size() && pixels_per_patch_pixel * *level_scale >= 1.5) {
    *level_scale *= 0.5;
    ++level;
  }
  return image.levels[level];
}

/// A random window, as the affine map from patch pixels to pixels of the level.
cv::Matx23d random_window(const LabImage& level, double side, int size, const PatchDistortion& distortion,
                          SequentialRng& rng) {
  const auto symmetric = [&](double reach) { return (2 * double(rng.uniform()) - 1) * reach; };
  const double angle = symmetric(distortion.rotation) * std::numbers::pi / 180;
  const double stretch = std::exp(0.5 * symmetric(distortion.stretch));
  const double mirror = distortion.flip && rng.uniform() < 0.5f ? -1.0 : 1.0;
  const double half = 0.5 * side;
  const auto centre = [&](int extent) {
    const double low = std::min(half, 0.5 * extent);
    return low + double(rng.uniform()) * (extent - 2 * low);
  };
  const double x = centre(level.width), y = centre(level.height), scale = side / size;
  const double c = std::cos(angle), s = std::sin(angle);
  const double xx = mirror * scale * stretch * c, xy = -scale / stretch * s;
  const double yx = mirror * scale * stretch * s, yy = scale / stretch * c;
  const double middle = 0.5 * (size - 1);
  return {xx, xy, x - 0.5 - (xx + xy) * middle, yx, yy, y - 0.5 - (yx + yy) * middle};
}

void distort_lightness(cv::Mat& lightness, const PatchDistortion& distortion, SequentialRng& rng) {
  const auto symmetric = [&](double reach) { return float((2 * rng.uniform() - 1) * reach); };
  const float gamma = std::exp(symmetric(distortion.log_gamma)), contrast = 1 + symmetric(distortion.contrast);
  const float sigma = rng.uniform() * float(distortion.blur), noise = rng.uniform() * float(distortion.noise);
  if (rng.uniform() < 0.5f && sigma > 0.3f) cv::GaussianBlur(lightness, lightness, {}, sigma);
  for (auto pixel = lightness.begin<float>(); pixel != lightness.end<float>(); ++pixel) {
    const float toned = 100 * contrast * std::pow(std::clamp(*pixel / 100, 0.0f, 1.0f), gamma);
    // A triangular distribution: cheaper than a normal one, and as good here.
    const float grain = noise * 2.45f * (rng.uniform() + rng.uniform() - 1);
    *pixel = std::clamp(toned + grain, 0.0f, 100.0f);
  }
}

/// Mean |ab| of what is known: how far grey is from it. Nothing where nothing is.
std::optional<double> mean_chroma(const LabImage& image) {
  double sum = 0;
  std::size_t pixels = 0;
  for (std::size_t i = 0; i < image.lab.size(); i += 3) {
    if (std::isnan(image.lab[i + 1])) continue;
    sum += std::hypot(image.lab[i + 1], image.lab[i + 2]);
    ++pixels;
  }
  return pixels > 0 ? std::optional(sum / double(pixels)) : std::nullopt;
}

}  // namespace

ReferenceImage load_reference_image(const std::filesystem::path& file) {
  ReferenceImage image = pyramid_of(read_linear_rgba(file));
  const std::optional<double> chroma = mean_chroma(image.counted());
  if (!chroma) throw InputError(file, "alpha", "a reference must show something; this one is transparent");
  if (*chroma < kLeastChroma) {
    throw InputError(file, "", "a reference must be a colour photograph; this one is grey");
  }
  return image;
}

void sample_reference_patch(std::span<const ReferenceImage> images, const PatchDistortion& distortion, int size,
                            SequentialRng& rng, std::span<float> lightness, std::span<float> ab) {
  const ReferenceImage& image = images[rng.below(std::uint32_t(images.size()))];
  const double share = distortion.share_min * std::pow(distortion.share_max / distortion.share_min, rng.uniform());
  const double side = share * std::min(image.levels[0].width, image.levels[0].height);
  double level_scale = 1;
  const LabImage& level = level_for(image, side / size, &level_scale);
  const cv::Matx23d window = random_window(level, side * level_scale, size, distortion, rng);
  const cv::Mat source(level.height, level.width, CV_32FC3, const_cast<float*>(level.lab.data()));
  cv::Mat patch;
  cv::warpAffine(source, patch, window, {size, size}, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REFLECT_101);

  const std::size_t pixels = std::size_t(size) * std::size_t(size);
  cv::Mat planes[3] = {cv::Mat(size, size, CV_32F, lightness.data()), cv::Mat(size, size, CV_32F, ab.data()),
                       cv::Mat(size, size, CV_32F, ab.data() + pixels)};
  cv::split(patch, planes);
  distort_lightness(planes[0], distortion, rng);
}

}  // namespace cnerf
