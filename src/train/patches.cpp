#include "src/train/patches.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "src/engine/chroma_engine.h"

namespace cnerf {
namespace {

/// The square of a [H, W] array, resized to K x K.
std::vector<float> resized_square(std::span<const float> image, const CachedView& view, const PatchPlace& place,
                                  int k) {
  const cv::Mat whole(view.height, view.width, CV_32F, const_cast<float*>(image.data()));
  const cv::Mat square = whole(cv::Rect(place.left, place.top, place.side, place.side));
  std::vector<float> values(std::size_t(k) * k);
  cv::Mat out(k, k, CV_32F, values.data());
  cv::resize(square, out, out.size(), 0, 0, place.side > k ? cv::INTER_AREA : cv::INTER_LINEAR);
  return values;
}

Ab bilinear(const std::vector<float>& ab, int k, float x, float y) {
  const float limit = float(k) - 1.0f;
  x = std::clamp(x, 0.0f, limit);
  y = std::clamp(y, 0.0f, limit);
  const int x0 = std::min(int(x), k - 2), y0 = std::min(int(y), k - 2);
  const float fx = x - float(x0), fy = y - float(y0);
  const auto channel = [&](int c) {
    const float* at = ab.data() + (std::size_t(c) * k + y0) * k + x0;
    return (1 - fy) * ((1 - fx) * at[0] + fx * at[1]) + fy * ((1 - fx) * at[k] + fx * at[k + 1]);
  };
  return {channel(0), channel(1)};
}

}  // namespace

PatchPlace random_patch(const std::vector<CachedView>& views, std::size_t view, double scale_min, double scale_max,
                        std::uint64_t seed, std::uint64_t index) {
  const CounterRng rng(seed ^ 0x7061746368ull, index);
  const CachedView& cached = views[view];
  const double scale = scale_min + (scale_max - scale_min) * double(rng.uniform(0));
  PatchPlace place;
  place.view = view;
  place.side = std::clamp(int(std::lround(scale * cached.short_side())), 2, cached.short_side());
  place.left = int(rng.below(1, std::uint32_t(cached.width - place.side + 1)));
  place.top = int(rng.below(2, std::uint32_t(cached.height - place.side + 1)));
  return place;
}

RenderedPatch render_patch(const CachedView& view, const PatchPlace& place, int k) {
  RenderedPatch patch;
  patch.lightness = resized_square(view.luminance, view, place, k);
  for (float& value : patch.lightness) value = std::clamp(lightness_from_luminance(value), 0.0f, 100.0f);
  patch.opacity = resized_square(view.opacity, view, place, k);
  return patch;
}

std::vector<float> patch_colors(const CachedView& view, const PatchPlace& place, int k, const std::vector<float>& ab) {
  const std::span<const float> all(ab);
  std::vector<float> patch = resized_square(all.first(ab.size() / 2), view, place, k);
  const std::vector<float> b = resized_square(all.last(ab.size() / 2), view, place, k);
  patch.insert(patch.end(), b.begin(), b.end());
  return patch;
}

PatchPixels pick_pixels(const CachedView& view, const PatchPlace& place, int k, const std::vector<float>& ab, int count,
                        std::uint64_t seed, std::uint64_t index) {
  const CounterRng rng(seed ^ 0x706978656cull, index);
  PatchPixels picked;
  const float scale = float(k) / float(place.side);
  for (int i = 0; i < count; ++i) {
    const int x = int(rng.below(2 * std::uint64_t(i), std::uint32_t(place.side)));
    const int y = int(rng.below(2 * std::uint64_t(i) + 1, std::uint32_t(place.side)));
    const auto pixel = std::uint32_t((place.top + y) * view.width + place.left + x);
    if (view.opacity[pixel] < kLeastColoredOpacity) continue;
    picked.pixels.push_back(pixel);
    picked.colors.push_back(bilinear(ab, k, (float(x) + 0.5f) * scale - 0.5f, (float(y) + 0.5f) * scale - 0.5f));
  }
  return picked;
}

}  // namespace cnerf
