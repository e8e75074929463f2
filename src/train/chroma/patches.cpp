#include "src/train/chroma/patches.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/base/rng.h"
#include "src/color/colorspace_math.h"
#include "src/engine/color_engines.h"

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

/// The nearest to `wanted` that a patch of the view may have: two pixels at least, where the view has two.
int side_in(const CachedView& view, int wanted) {
  return std::clamp(wanted, std::min(2, view.short_side()), view.short_side());
}

/// A place between the pixels of a K x K plane.
class PlanePoint {
 public:
  PlanePoint(int k, float x, float y) : k_(std::size_t(k)) {
    const float limit = float(k) - 1.0f;
    x = std::clamp(x, 0.0f, limit);
    y = std::clamp(y, 0.0f, limit);
    x_ = std::min(int(x), k - 2);
    y_ = std::min(int(y), k - 2);
    fx_ = x - float(x_);
    fy_ = y - float(y_);
  }
  /// @param planes  [any, K, K]
  [[nodiscard]] float value(const std::vector<float>& planes, std::size_t plane) const {
    const float* at = planes.data() + (plane * k_ + std::size_t(y_)) * k_ + std::size_t(x_);
    return (1 - fy_) * ((1 - fx_) * at[0] + fx_ * at[1]) + fy_ * ((1 - fx_) * at[k_] + fx_ * at[k_ + 1]);
  }

 private:
  std::size_t k_;
  int x_ = 0, y_ = 0;
  float fx_ = 0, fy_ = 0;
};

}  // namespace

PatchPlace random_patch(std::span<const CachedView> views, std::size_t view, PatchScale scale, std::uint64_t seed,
                        std::uint64_t index) {
  const CounterRng rng(seed ^ named_stream("patch"), index);
  const CachedView& cached = views[view];
  const double share = scale.least + (scale.most - scale.least) * double(rng.uniform(0));
  PatchPlace place;
  place.view = view;
  place.index = index;
  place.side = side_in(cached, int(std::lround(share * cached.short_side())));
  place.left = int(rng.below(1, std::uint32_t(cached.width - place.side + 1)));
  place.top = int(rng.below(2, std::uint32_t(cached.height - place.side + 1)));
  return place;
}

PatchPlace near_patch(std::span<const CachedView> views, const PatchPlace& place, std::uint64_t seed,
                      std::uint64_t index) {
  constexpr double kMost = 0.05;
  const CounterRng rng(seed ^ named_stream("near"), index);
  const CachedView& cached = views[place.view];
  const auto off = [&](std::uint64_t draw) {
    return int(std::lround(kMost * place.side * (2 * double(rng.uniform(draw)) - 1)));
  };
  PatchPlace moved = place;
  moved.index = index;
  moved.side = side_in(cached, place.side + off(0));
  moved.left = std::clamp(place.left + off(1), 0, cached.width - moved.side);
  moved.top = std::clamp(place.top + off(2), 0, cached.height - moved.side);
  return moved;
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

float certainty_weight(float certainty, double sure_colors) {
  if (sure_colors == 0) return 1;
  const float share = std::min(1.0f, float(sure_colors) * certainty);
  return share * share;
}

PatchPixels pick_pixels(const CachedView& view, const AnsweredPatch& patch, int count, std::uint64_t seed,
                        std::uint64_t index) {
  const PatchPlace& place = patch.place;
  const int k = patch.side;
  const CounterRng rng(seed ^ named_stream("pixel"), index);
  PatchPixels picked;
  const float scale = float(k) / float(place.side);
  for (int i = 0; i < count; ++i) {
    const int x = int(rng.below(2 * std::uint64_t(i), std::uint32_t(place.side)));
    const int y = int(rng.below(2 * std::uint64_t(i) + 1, std::uint32_t(place.side)));
    const auto pixel = std::uint32_t((place.top + y) * view.width + place.left + x);
    if (view.opacity[pixel] < kLeastColoredOpacity) continue;
    picked.pixels.push_back(pixel);
    const PlanePoint point(k, (float(x) + 0.5f) * scale - 0.5f, (float(y) + 0.5f) * scale - 0.5f);
    picked.colors.push_back({point.value(patch.ab, 0), point.value(patch.ab, 1)});
    picked.certainty.push_back(patch.certainty.empty() ? 1 : point.value(patch.certainty, 0));
  }
  return picked;
}

}  // namespace cnerf
