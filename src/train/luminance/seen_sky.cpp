#include "src/train/luminance/seen_sky.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/base/parallel.h"
#include "src/base/statistics.h"
#include "src/capture/arrangement.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr int kMapWidth = 512;              // 0.7 degrees per pixel
constexpr int kLongSide = 256;              // of the pictures that are searched, pixels
constexpr float kHorizon = -0.02f;          // least elevation of the sky, as a sine: horizons are not level
constexpr float kNearHorizon = 0.03f;       // where the sky comes down to it
constexpr float kFarElevation = 0.12f;      // above and below the horizon, of what is far where nothing hides it
constexpr float kSeedElevation = 0.05f;     // of where the search begins
constexpr float kLeastLightness = 40;       // L* of a sky
constexpr double kDarkPart = 0.25;          // of what is below the horizon: snow and haze are as bright as a sky
constexpr float kBrighter = 8;              // L* that it has over what is below
constexpr float kSmooth = 2;                // L* between neighbours
constexpr double kLeastShare = 0.05;        // of a picture, and of its border, that a sky takes
constexpr float kThinThing = 8;             // L* from what is around: a wire, a twig
constexpr int kInside = 2, kEdge = 3;       // searched pixels within the sky's border, and beyond it
constexpr float kDarkest = 2;               // L* below the darkest twentieth of a view's sky, of a gap that may show it
constexpr double kPointShare = 0.15;        // of the picture's density of points, that a sky has at most
constexpr std::size_t kTellingPoints = 30;  // of a view: fewer say nothing
constexpr float kFarShare = 0.02f;          // of the weight of a pixel of the sky, in the map
constexpr float kSame = 1.5f;               // L* from the map, of a pixel that shows the sky after all
constexpr float kUnlike = 3.5f;             // L* from what other views see there: no sky
constexpr double kLeastViews = 0.5;         // of all views, that have to show it
constexpr std::size_t kReadPixels = 30000;  // of a view, for the map

/// A picture that is searched.
struct SearchedView {
  int width = 0, height = 0;
  std::vector<float> lightness;      // [H, W] L*
  std::vector<float> elevation;      // [H, W] sine of the angle over the horizon
  std::vector<std::uint8_t> is_sky;  // [H, W]

  [[nodiscard]] std::size_t at(int x, int y) const { return std::size_t(y) * std::size_t(width) + std::size_t(x); }
  [[nodiscard]] bool holds(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }
  [[nodiscard]] bool shows_sky() const { return std::ranges::find(is_sky, 1) != is_sky.end(); }
};

/// Along an axis, where a searched pixel begins in the picture.
int begin_of(int searched, int of_searched, int of_picture) {
  return int(std::int64_t(searched) * of_picture / of_searched);
}

SearchedView reduced(const TrainingView& view, Vec3d up) {
  const MonoImage& image = *view.image;
  const double scale = std::min(1.0, double(kLongSide) / std::max(image.width, image.height));
  SearchedView small;
  small.width = std::max(1, int(std::lround(image.width * scale)));
  small.height = std::max(1, int(std::lround(image.height * scale)));
  for (int y = 0; y < small.height; ++y) {
    const int top = begin_of(y, small.height, image.height), bottom = begin_of(y + 1, small.height, image.height);
    for (int x = 0; x < small.width; ++x) {
      const int left = begin_of(x, small.width, image.width), right = begin_of(x + 1, small.width, image.width);
      double sum = 0;
      for (int v = top; v < bottom; ++v) {
        for (int u = left; u < right; ++u) {
          sum += double(image.luminance(std::size_t(v) * std::size_t(image.width) + std::size_t(u)));
        }
      }
      small.lightness.push_back(lightness_from_luminance(float(sum / ((bottom - top) * (right - left)))));
      const PixelPosition middle{0.5 * (left + right), 0.5 * (top + bottom)};
      small.elevation.push_back(dot(view.camera.ray(middle).direction, up.cast<float>()));
    }
  }
  small.is_sky.assign(small.lightness.size(), 0);
  return small;
}

/// L* over which a pixel may be sky.
float least_lightness(const SearchedView& view) {
  std::vector<float> below;
  for (std::size_t p = 0; p < view.lightness.size(); ++p) {
    if (view.elevation[p] < 0) below.push_back(view.lightness[p]);
  }
  if (below.size() < view.lightness.size() / 20) below = view.lightness;
  return std::max(kLeastLightness, quantile(std::move(below), kDarkPart) + kBrighter);
}

/// Marks what is reached from the picture's border over smooth, bright pixels.
void grow(SearchedView& view) {
  const float least = least_lightness(view);
  std::vector<std::pair<int, int>> front;
  const auto take = [&](int x, int y, float elevation) {
    const std::size_t p = view.at(x, y);
    if (view.is_sky[p] != 0 || view.elevation[p] < elevation || view.lightness[p] < least) return;
    view.is_sky[p] = 1;
    front.emplace_back(x, y);
  };
  for (int x = 0; x < view.width; ++x) {
    for (const int y : {0, view.height - 1}) take(x, y, kSeedElevation);
  }
  for (int y = 0; y < view.height; ++y) {
    for (const int x : {0, view.width - 1}) take(x, y, kSeedElevation);
  }
  std::size_t marked = 0, on_border = 0;
  while (!front.empty()) {
    const auto [x, y] = front.back();
    front.pop_back();
    ++marked;
    if (x == 0 || y == 0 || x == view.width - 1 || y == view.height - 1) ++on_border;
    for (const auto& [u, v] : {std::pair{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
      if (!view.holds(u, v)) continue;
      if (std::abs(view.lightness[view.at(u, v)] - view.lightness[view.at(x, y)]) < kSmooth) take(u, v, kHorizon);
    }
  }
  const double border = 2.0 * (view.width + view.height);
  if (double(marked) < kLeastShare * double(view.is_sky.size()) || double(on_border) < kLeastShare * border) {
    std::ranges::fill(view.is_sky, 0);
  }
}

/// Whether all pixels, or any, in a square around one are marked. What is beyond the picture goes on as its border.
template <bool kAll>
bool marked_around(const SearchedView& view, int x, int y, int radius) {
  for (int v = std::max(0, y - radius); v <= std::min(view.height - 1, y + radius); ++v) {
    for (int u = std::max(0, x - radius); u <= std::min(view.width - 1, x + radius); ++u) {
      if ((view.is_sky[view.at(u, v)] != 0) != kAll) return !kAll;
    }
  }
  return kAll;
}

/// Points where a sky has none mean that it is something else.
void unmark_structured(const View& view, const std::vector<Vec3d>& points, SearchedView& small) {
  const Affined camera_from_world = view.world_from_camera.inverse();
  std::size_t in_picture = 0, in_sky = 0;
  for (const Vec3d& point : points) {
    const auto pixel = project(view.intrinsics, camera_from_world.point(point));
    if (!pixel) continue;
    const int x = int(std::floor(pixel->x * small.width / view.intrinsics.width));
    const int y = int(std::floor(pixel->y * small.height / view.intrinsics.height));
    if (!small.holds(x, y)) continue;
    ++in_picture;
    if (marked_around<true>(small, x, y, kInside)) ++in_sky;
  }
  if (in_picture < kTellingPoints) return;
  const double area = double(std::ranges::count(small.is_sky, 1)) / double(small.is_sky.size());
  if (double(in_sky) > kPointShare * area * double(in_picture)) std::ranges::fill(small.is_sky, 0);
}

/// Marks columns in which the sky comes down to the horizon: what is below it there is far.
std::vector<bool> open_columns(const SearchedView& small) {
  std::vector<bool> open(std::size_t(small.width), false);
  for (int x = 0; x < small.width; ++x) {
    for (int y = 0; y < small.height; ++y) {
      const std::size_t p = small.at(x, y);
      if (small.is_sky[p] != 0 && small.elevation[p] < kNearHorizon) open[std::size_t(x)] = true;
    }
  }
  return open;
}

std::vector<SkyLabel> labels_of(const SearchedView& small, const MonoImage& image) {
  std::vector<float> of_sky;
  for (std::size_t p = 0; p < small.is_sky.size(); ++p) {
    if (small.is_sky[p] != 0) of_sky.push_back(small.lightness[p]);
  }
  const float darkest = quantile(std::move(of_sky), 0.05) - kDarkest;
  const std::vector<bool> is_open = open_columns(small);
  std::vector<SkyLabel> of_small;
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      const std::size_t p = small.at(x, y);
      const bool is_gap = small.elevation[p] > kHorizon && small.lightness[p] > darkest;
      const bool is_far = is_open[std::size_t(x)] && std::abs(small.elevation[p]) < kFarElevation;
      of_small.push_back(marked_around<true>(small, x, y, kInside)            ? SkyLabel::kSky
                         : is_far                                             ? SkyLabel::kFar
                         : is_gap || marked_around<false>(small, x, y, kEdge) ? SkyLabel::kEither
                                                                              : SkyLabel::kScene);
    }
  }
  std::vector<SkyLabel> labels(image.pixel_count());
  for (std::size_t p = 0; p < labels.size(); ++p) {
    if (!image.valid(p)) continue;  // who masks a sky wants none
    const auto x = std::int64_t(p) % image.width, y = std::int64_t(p) / image.width;
    const std::size_t from = small.at(int(x * small.width / image.width), int(y * small.height / image.height));
    const bool is_thin = std::abs(lightness_from_luminance(image.luminance(p)) - small.lightness[from]) > kThinThing;
    labels[p] = of_small[from] == SkyLabel::kSky && is_thin ? SkyLabel::kEither : of_small[from];
  }
  return labels;
}

/// Calls `visit(direction, luminance, share)` for some of a view's sky pixels; the share falls to the picture's border,
/// so that seams between views do not show.
template <typename Visit>
void for_sky_pixels(const TrainingView& view, const std::vector<SkyLabel>& labels, const ViewCorrection& correction,
                    Visit&& visit) {
  if (labels.empty()) return;
  const MonoImage& image = *view.image;
  const std::size_t step = std::max<std::size_t>(1, image.pixel_count() / kReadPixels) | 1;  // odd: no columns
  for (std::size_t p = 0; p < labels.size(); p += step) {
    const float certain = labels[p] == SkyLabel::kSky ? 1 : labels[p] == SkyLabel::kFar ? kFarShare : 0;
    if (certain == 0 || !image.valid(p)) continue;
    const double x = double(p % std::size_t(image.width)) + 0.5, y = double(p / std::size_t(image.width)) + 0.5;
    const double across = std::min(x, image.width - x) / image.width,
                 down = std::min(y, image.height - y) / image.height;
    const Ray ray = correction.applied_to(view.camera.ray_of_pixel(p));
    visit(ray.direction, image.luminance(p) / correction.gain(),
          certain * float(std::min(1.0, 8 * std::min(across, down))));
  }
}

/// How a view's sky fits the map.
struct SkyFit {
  float gain = 1;  ///< of the view's exposure
  float miss = 0;  ///< L*, the median over its pixels; infinite where it shows none
};

SkyFit fit_of(const TrainingView& view, const std::vector<SkyLabel>& labels, const DirectionMap& light) {
  std::vector<std::pair<float, float>> pairs;
  std::vector<float> ratios, misses;
  const DirectionView seen = light.plane(0);
  for_sky_pixels(view, labels, {}, [&](Vec3f direction, float luminance, float) {
    const float expected = std::max(seen.along(direction), 1e-4f);
    pairs.emplace_back(luminance, expected);
    ratios.push_back(luminance / expected);
  });
  if (pairs.empty()) return {1, std::numeric_limits<float>::infinity()};
  const float gain = std::max(median(std::move(ratios)), 1e-4f);
  for (const auto& [luminance, expected] : pairs) {
    misses.push_back(std::abs(lightness_from_luminance(luminance / gain) - lightness_from_luminance(expected)));
  }
  return {gain, median(std::move(misses))};
}

/// Pixels that may show the sky, or what is far, do where they and those around them look like it.
void settle_either(const TrainingView& view, const DirectionMap& light, float gain, std::vector<SkyLabel>& labels) {
  const int width = view.image->width, height = view.image->height;
  std::vector<signed char> looks(labels.size());  // 1: like it, -1: unlike, 0: not known yet, as of most
  const auto looks_like_it = [&](std::size_t p) {
    if (looks[p] == 0) {
      const float expected = light.plane(0).along(view.camera.ray_of_pixel(p).direction);
      const float miss = lightness_from_luminance(view.image->luminance(p) / gain) - lightness_from_luminance(expected);
      looks[p] = std::abs(miss) < kSame ? 1 : -1;
    }
    return looks[p] > 0;
  };
  const auto all_around = [&](int x, int y) {
    for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u) {
        if (!looks_like_it(std::size_t(v) * std::size_t(width) + std::size_t(u))) return false;
      }
    }
    return true;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      SkyLabel& label = labels[std::size_t(y) * std::size_t(width) + std::size_t(x)];
      if ((label == SkyLabel::kEither || label == SkyLabel::kFar) && all_around(x, y)) label = SkyLabel::kSky;
    }
  }
}

std::vector<const View*> training_views_of(const Capture& capture) {
  std::vector<const View*> views;
  for (const View& view : capture.views) {
    if (!view.held_out) views.push_back(&view);
  }
  return views;
}

/// [training views] the points that each shows.
std::vector<std::vector<Vec3d>> points_by_view(const Capture& capture, const std::vector<SparsePoint>& points) {
  std::vector<std::vector<Vec3d>> shown(capture.views.size());
  for (const SparsePoint& point : points) {
    for (const std::uint32_t view : point.views) shown[view].push_back(point.position);
  }
  std::vector<std::vector<Vec3d>> of_training;
  for (std::size_t v = 0; v < shown.size(); ++v) {
    if (!capture.views[v].held_out) of_training.push_back(std::move(shown[v]));
  }
  return of_training;
}

bool enough_views(const SeenSky& sky) {
  return sky.views() >= 2 && double(sky.views()) >= kLeastViews * double(sky.labels.size());
}

}  // namespace

int SeenSky::views() const {
  return int(std::ranges::count_if(labels, [](const auto& of_view) { return !of_view.empty(); }));
}

double SeenSky::share(std::span<const TrainingView> of) const {
  double sky = 0, all = 0;
  for (const auto& of_view : labels) sky += double(std::ranges::count(of_view, SkyLabel::kSky));
  for (const TrainingView& view : of) all += double(view.image->pixel_count());
  return all > 0 ? sky / all : 0;
}

void SeenSky::show_to(std::vector<TrainingView>& views) const {
  for (std::size_t v = 0; v < labels.size() && light.exists(); ++v) {
    if (labels[v].empty()) continue;
    views[v].sky_labels = &labels[v];
    views[v].sky = &light;
  }
}

SeenSky find_sky(const Capture& capture, std::span<const TrainingView> views, const std::vector<SparsePoint>& points) {
  SeenSky sky;
  if (capture.is_bounded_object || views.empty()) return sky;
  const Vec3d up = arrangement_of(capture).up;
  const std::vector<const View*> of_capture = training_views_of(capture);
  const std::vector<std::vector<Vec3d>> shown = points_by_view(capture, points);
  sky.labels.resize(views.size());
  parallel_tasks(views.size(), [&](std::size_t v) {
    if (!views[v].image->alpha.empty()) return;
    SearchedView small = reduced(views[v], up);
    grow(small);
    unmark_structured(*of_capture[v], shown[v], small);
    if (!small.shows_sky()) return;
    std::vector<SkyLabel> labels = labels_of(small, *views[v].image);
    if (std::ranges::find(labels, SkyLabel::kSky) != labels.end()) sky.labels[v] = std::move(labels);
  });
  if (!enough_views(sky)) return {};
  DirectionMap light = sky_light(views, sky.labels, {});
  parallel_tasks(views.size(), [&](std::size_t v) {
    const SkyFit fit = fit_of(views[v], sky.labels[v], light);
    fit.miss < kUnlike ? settle_either(views[v], light, fit.gain, sky.labels[v]) : sky.labels[v].clear();
  });
  if (!enough_views(sky)) return {};
  sky.light = sky_light(views, sky.labels, {});
  return sky;
}

DirectionMap sky_light(std::span<const TrainingView> views, const std::vector<std::vector<SkyLabel>>& labels,
                       std::span<const ViewCorrection> corrections) {
  DirectionSums sums(kMapWidth, 1);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const ViewCorrection correction = corrections.empty() ? ViewCorrection() : corrections[v];
    for_sky_pixels(views[v], labels[v], correction, [&](Vec3f direction, float luminance, float share) {
      sums.add(direction, std::span(&luminance, 1), share);
    });
  }
  return sums.filled();
}

}  // namespace cnerf
