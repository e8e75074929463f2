#include "src/train/patches.h"

#include <algorithm>
#include <cmath>
#include <numeric>
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
  const CounterRng rng(seed ^ named_stream("patch"), index);
  const CachedView& cached = views[view];
  const double scale = scale_min + (scale_max - scale_min) * double(rng.uniform(0));
  PatchPlace place;
  place.view = view;
  place.index = index;
  place.side = std::clamp(int(std::lround(scale * cached.short_side())), 2, cached.short_side());
  place.left = int(rng.below(1, std::uint32_t(cached.width - place.side + 1)));
  place.top = int(rng.below(2, std::uint32_t(cached.height - place.side + 1)));
  return place;
}

PatchPlace near_patch(const std::vector<CachedView>& views, const PatchPlace& place, std::uint64_t seed,
                      std::uint64_t index) {
  constexpr double kMost = 0.05;
  const CounterRng rng(seed ^ named_stream("near"), index);
  const CachedView& cached = views[place.view];
  const auto off = [&](std::uint64_t draw) {
    return int(std::lround(kMost * place.side * (2 * double(rng.uniform(draw)) - 1)));
  };
  PatchPlace moved = place;
  moved.index = index;
  moved.side = std::clamp(place.side + off(0), 2, cached.short_side());
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

LightnessBatch whole_view(const CachedView& view, const std::string& name, std::uint64_t query, int short_side) {
  const double factor = std::min(1.0, double(short_side) / view.short_side());
  const cv::Size size(std::max(2, int(std::lround(view.width * factor))),
                      std::max(2, int(std::lround(view.height * factor))));
  LightnessBatch question{1, size.height, size.width, std::vector<float>(std::size_t(size.area())), {}};
  const cv::Mat luminance(view.height, view.width, CV_32F, const_cast<float*>(view.luminance.data()));
  cv::Mat shown(size, CV_32F, question.lightness.data());
  cv::resize(luminance, shown, size, 0, 0, cv::INTER_AREA);
  for (float& value : question.lightness) value = std::clamp(lightness_from_luminance(value), 0.0f, 100.0f);
  question.origins.push_back({name, 0, 0, 1, 1, query});
  return question;
}

std::vector<float> at_view_size(const CachedView& view, const LightnessBatch& question, const std::vector<float>& ab) {
  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  std::vector<float> out(2 * pixels);
  for (std::size_t c = 0; c < 2; ++c) {
    const cv::Mat answer(question.height, question.width, CV_32F,
                         const_cast<float*>(ab.data()) + c * question.lightness.size());
    cv::Mat whole(view.height, view.width, CV_32F, out.data() + c * pixels);
    cv::resize(answer, whole, whole.size(), 0, 0, cv::INTER_LINEAR);
  }
  return out;
}

std::vector<std::size_t> along_the_path(const std::vector<CachedView>& views) {
  std::vector<std::size_t> path, left(views.size());
  std::iota(left.begin(), left.end(), std::size_t(0));
  while (!left.empty()) {
    auto next = left.begin();
    if (!path.empty()) {
      const Vec3d here = views[path.back()].camera.origin;
      next = std::ranges::min_element(left, {}, [&](std::size_t v) { return length(views[v].camera.origin - here); });
    }
    path.push_back(*next);
    left.erase(next);
  }
  return path;
}

PatchPixels pick_pixels(const CachedView& view, const PatchPlace& place, int k, const std::vector<float>& ab, int count,
                        std::uint64_t seed, std::uint64_t index) {
  const CounterRng rng(seed ^ named_stream("pixel"), index);
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
