#include "src/capture/black_background.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "src/base/parallel.h"
#include "src/base/statistics.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr double kBlackest = 8;         ///< sRGB codes, of the median of a rim
constexpr double kAgainstLight = 0.06;  ///< of the picture's lightest hundredth, that a black rim stays below
constexpr double kLeastReach = 4;       ///< codes above the rim's median that are black too; more where there is grain
constexpr double kGrainReach = 4;       ///< standard deviations
constexpr double kRimShare = 0.5;       ///< of a view's rim that is black: objects may be cut by the picture
constexpr double kEmptyShare = 0.05;    ///< of a view that is empty at least
constexpr int kRim = 2;                 ///< pixels

float code_of(float light) {
  return 255 * srgb_from_linear(std::clamp(light, 0.0f, 1.0f));
}

/// sRGB codes, grain averaged.
cv::Mat1f codes_of(const MonoImage& image) {
  cv::Mat1f codes(image.height, image.width);
  float* const out = codes.ptr<float>();
  if (image.depth == PixelDepth::kU8) {
    std::array<float, 256> code_of_byte;
    for (std::size_t byte = 0; byte < 256; ++byte) {
      code_of_byte[byte] = code_of(decode_transfer(image.transfer, float(byte) / 255.0f));
    }
    for (std::size_t p = 0; p < image.pixel_count(); ++p) out[p] = code_of_byte[image.u8[p]];
  } else {
    for (std::size_t p = 0; p < image.pixel_count(); ++p) out[p] = code_of(image.stored_luminance(p));
  }
  cv::blur(codes, codes, {3, 3});
  return codes;
}

cv::Mat1b rim_of(cv::Size size) {
  cv::Mat1b rim(size, std::uint8_t(255));
  rim(cv::Rect(kRim, kRim, size.width - 2 * kRim, size.height - 2 * kRim)) = 0;
  return rim;
}

/// 255 where the view shows nothing; no value if it does not stand before black.
std::optional<cv::Mat1b> empty_part(const MonoImage& image) {
  if (!image.alpha.empty() || image.width < 8 * kRim || image.height < 8 * kRim) return std::nullopt;
  const cv::Mat1f codes = codes_of(image);
  const cv::Mat1b rim = rim_of(codes.size());
  std::vector<float> at_rim;
  for (int y = 0; y < codes.rows; ++y) {
    for (int x = 0; x < codes.cols; ++x) {
      if (rim(y, x) != 0) at_rim.push_back(codes(y, x));
    }
  }
  const float level = quantile(at_rim, 0.5);
  if (level > kBlackest || level > kAgainstLight * quantile(std::vector(codes.begin(), codes.end()), 0.99))
    return std::nullopt;
  // The darker half of the rim lies below its median: its spread is that of the grain.
  const double grain = 1.5 * (level - quantile(at_rim, 0.16));
  const double limit = level + std::max(kLeastReach, kGrainReach * grain);
  const auto black = std::ranges::count_if(at_rim, [&](float code) { return code <= limit; });
  if (double(black) < kRimShare * double(at_rim.size())) return std::nullopt;

  const cv::Mat1b dark = codes <= limit;
  cv::Mat1i labels;
  const int count = cv::connectedComponents(dark, labels);
  std::vector<bool> reaches_rim(std::size_t(count), false);
  for (int y = 0; y < codes.rows; ++y) {
    for (int x = 0; x < codes.cols; ++x) {
      if (rim(y, x) != 0 && dark(y, x) != 0) reaches_rim[std::size_t(labels(y, x))] = true;
    }
  }
  cv::Mat1b empty(codes.size(), std::uint8_t(0));
  for (int y = 0; y < codes.rows; ++y) {
    for (int x = 0; x < codes.cols; ++x) {
      if (dark(y, x) != 0 && reaches_rim[std::size_t(labels(y, x))]) empty(y, x) = 255;
    }
  }
  if (cv::countNonZero(empty) < kEmptyShare * double(empty.total())) return std::nullopt;
  return empty;
}

/// A bit for each pixel: many views are looked at before it is known whether any is cut out.
std::vector<bool> bits_of(const cv::Mat1b& part) {
  std::vector<bool> bits;
  bits.reserve(part.total());
  for (const std::uint8_t value : part) bits.push_back(value != 0);
  return bits;
}

void cut_out(MonoImage& image, const std::vector<bool>& empty) {
  image.u8.bring_to_memory();
  image.u16.bring_to_memory();
  image.f32.bring_to_memory();
  image.alpha.assign(image.pixel_count(), 255);
  for (std::size_t p = 0; p < image.pixel_count(); ++p) {
    if (!empty[p]) continue;
    image.alpha[p] = 0;
    if (!image.u8.empty()) image.u8[p] = 0;
    if (!image.u16.empty()) image.u16[p] = 0;
    if (!image.f32.empty()) image.f32[p] = 0;
  }
}

}  // namespace

bool cut_out_of_black(std::vector<View>& views, const std::function<void(MonoImage&)>& changed) {
  std::vector<std::vector<bool>> empty(views.size());
  std::atomic<bool> all_are_before_black = true;
  parallel_tasks(views.size(), [&](std::size_t v) {
    if (!all_are_before_black) return;
    if (const std::optional<cv::Mat1b> part = empty_part(views[v].image)) {
      empty[v] = bits_of(*part);
    } else {
      all_are_before_black = false;
    }
  });
  if (!all_are_before_black) return false;
  for (std::size_t v = 0; v < views.size(); ++v) {
    cut_out(views[v].image, empty[v]);
    changed(views[v].image);
  }
  return true;
}

}  // namespace cnerf
