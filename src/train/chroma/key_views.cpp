#include "src/train/chroma/key_views.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "src/base/check.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/train/chroma/likeness.h"

namespace cnerf {
namespace {

constexpr double kAlike = 0.7;  // of what a view tells by showing it
// How far looks differ by 1.
constexpr float kLightness = 12;  // L* of the pixels around
constexpr float kTexture = 6;     // L*, their standard deviation
constexpr float kContrast = 12;   // L* to a wider surrounding
constexpr int kWide = 8;          // pixels on each side that it reaches

/// Means of a picture's squares of pixels, cut at its borders.
class SquareMeans {
 public:
  SquareMeans(std::span<const float> values, int width, int height)
      : width_(width), height_(height), sums_(std::size_t(width + 1) * std::size_t(height + 1)) {
    for (int y = 0; y < height; ++y) {
      double row = 0;
      for (int x = 0; x < width; ++x) {
        row += values[std::size_t(y) * std::size_t(width) + std::size_t(x)];
        sums_[at(x + 1, y + 1)] = sums_[at(x + 1, y)] + row;
      }
    }
  }
  [[nodiscard]] float around(int x, int y, int reach) const {
    const int left = std::max(x - reach, 0), right = std::min(x + reach + 1, width_);
    const int top = std::max(y - reach, 0), bottom = std::min(y + reach + 1, height_);
    const double sum =
        sums_[at(right, bottom)] - sums_[at(left, bottom)] - sums_[at(right, top)] + sums_[at(left, top)];
    return float(sum / (double(right - left) * (bottom - top)));
  }

 private:
  [[nodiscard]] std::size_t at(int x, int y) const { return std::size_t(y) * std::size_t(width_ + 1) + std::size_t(x); }
  int width_, height_;
  std::vector<double> sums_;
};

/// Of one view: points in evenly spaced pixels.
ScenePoints points_of(const CachedView& view, std::span<const float> surface, std::uint32_t number, std::size_t count) {
  std::vector<std::uint32_t> shown;
  for (std::uint32_t p = 0; p < view.opacity.size(); ++p) {
    if (view.opacity[p] >= kLeastColoredOpacity) shown.push_back(p);
  }
  ScenePoints points;
  if (shown.empty()) return points;
  const PixelLooks looks(view, surface);
  const SquareMeans wide(looks.lightness, view.width, view.height);
  const CounterRng rng(named_stream("keyviews"), number);
  for (std::size_t i = 0; i < count; ++i) {
    const double place = (double(i) + double(rng.uniform(i))) / double(count);
    const std::uint32_t p = shown[std::size_t(place * double(shown.size()))];
    const float around = wide.around(int(p) % view.width, int(p) / view.width, kWide);
    points.pixels.push_back({number, p});
    points.looks.push_back(
        {looks.lightness[p] / kLightness, looks.texture[p] / kTexture, (looks.lightness[p] - around) / kContrast});
  }
  return points;
}

float squared_distance(const ScenePoints::Looks& x, const ScenePoints::Looks& y) {
  float sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += (x[i] - y[i]) * (x[i] - y[i]);
  return sum;
}

/// What each view tells.
struct Told {
  std::vector<std::vector<std::uint8_t>> sees;  // [views][points]
  std::vector<std::vector<float>> tells;        // b  [views][points]
};

Told told_by(const SeenSurfaces& seen, const ScenePoints& points) {
  const std::span<const CachedView> views = seen.views();
  std::vector<Vec3d> places;
  std::vector<float> lightness;
  std::vector<bool> is_solid;
  for (const auto& [view, pixel] : points.pixels) {
    const float surface = seen.surface(view)[pixel];
    is_solid.push_back(surface > 0);
    places.push_back(views[view].camera.ray_of_pixel(pixel).at(surface).cast<double>());
    lightness.push_back(lightness_at(views[view], pixel));
  }
  const std::size_t count = points.pixels.size();
  Told told{std::vector(views.size(), std::vector<std::uint8_t>(count)),
            std::vector(views.size(), std::vector<float>(count))};
  parallel_tasks(views.size(), [&](std::size_t v) {
    const Sight sight(views[v], seen.surface(v));
    std::vector<std::size_t> shown;
    for (std::size_t p = 0; p < count; ++p) {
      const bool is_own = points.pixels[p].view == v;
      if (!is_own && !(is_solid[p] && sight.pixel_of(places[p], lightness[p]))) continue;
      told.sees[v][p] = 1;
      shown.push_back(p);
    }
    for (std::size_t p = 0; p < count; ++p) {
      float nearest = kUnreached;
      for (const std::size_t q : shown) nearest = std::min(nearest, squared_distance(points.looks[p], points.looks[q]));
      told.tells[v][p] = told.sees[v][p] != 0 ? 1.0f : float(kAlike) * std::exp(-nearest / 2);
    }
  });
  return told;
}

}  // namespace

ScenePoints scene_points(const SeenSurfaces& seen, std::size_t count) {
  const std::size_t views = seen.views().size();
  std::vector<ScenePoints> of_views(views);
  parallel_tasks(views, [&](std::size_t v) {
    of_views[v] =
        points_of(seen.views()[v], seen.surface(v), std::uint32_t(v), std::max<std::size_t>(count / views, 1));
  });
  ScenePoints points;
  for (const ScenePoints& some : of_views) {
    points.pixels.insert(points.pixels.end(), some.pixels.begin(), some.pixels.end());
    points.looks.insert(points.looks.end(), some.looks.begin(), some.looks.end());
  }
  points.doubt.assign(points.pixels.size(), 1.0f);
  return points;
}

float spread_of(std::span<const float> logits) {
  const auto& centres = ab_bin_centres();
  const float most = *std::ranges::max_element(logits);
  std::vector<float> shares;
  for (const float logit : logits) shares.push_back(std::exp(logit - most));
  const float total = std::accumulate(shares.begin(), shares.end(), 0.0f);
  Ab mean;
  for (std::size_t q = 0; q < shares.size(); ++q) {
    shares[q] /= total;
    mean = {mean.a + shares[q] * centres[q].a, mean.b + shares[q] * centres[q].b};
  }
  float spread = 0;
  for (std::size_t q = 0; q < shares.size(); ++q) {
    spread += shares[q] * std::hypot(centres[q].a - mean.a, centres[q].b - mean.b);
  }
  return spread;
}

std::vector<float> doubts_of(const ColorModel& take, std::span<const CachedView> views, const ScenePoints& points) {
  CNERF_CHECK(take.pixel_colors == PixelColors::kDistribution, "a take with a distribution");
  std::vector<float> logits(points.pixels.size() * kAbBinCount), doubts;
  take.chroma->logits(pixel_samples(views, points.pixels), logits);
  for (std::size_t p = 0; p < points.pixels.size(); ++p) {
    doubts.push_back(spread_of(std::span(logits).subspan(p * kAbBinCount, kAbBinCount)));
  }
  return doubts;
}

KeyViewChoice choose_key_views(const SeenSurfaces& seen, const ScenePoints& points, std::span<const std::size_t> given,
                               std::size_t count) {
  const std::size_t n = points.pixels.size();
  const double all = std::accumulate(points.doubt.begin(), points.doubt.end(), 0.0);
  if (!(all > 0)) return {};
  const Told told = told_by(seen, points);
  std::vector<float> so_far(n);
  const auto take = [&](std::size_t v) {
    for (std::size_t p = 0; p < n; ++p) so_far[p] = std::max(so_far[p], told.tells[v][p]);
  };
  const auto beside_others = [&](std::size_t v) {
    KeyView one{v};
    for (std::size_t p = 0; p < n; ++p) {
      one.adds += double(points.doubt[p]) / all * double(std::max(told.tells[v][p] - so_far[p], 0.0f));
      if (told.sees[v][p] != 0) one.shows += double(points.doubt[p]) / all;
    }
    return one;
  };
  for (const std::size_t v : given) take(v);
  KeyViewChoice choice;
  std::vector<std::size_t> left;
  for (std::size_t v = 0; v < seen.views().size(); ++v) {
    choice.alone.push_back(beside_others(v));
    if (std::ranges::find(given, v) == given.end()) left.push_back(v);
  }
  while (choice.chosen.size() < count && !left.empty()) {
    std::vector<KeyView> candidates;
    for (const std::size_t v : left) candidates.push_back(beside_others(v));
    choice.chosen.push_back(*std::ranges::max_element(candidates, {}, &KeyView::adds));
    take(choice.chosen.back().view);
    std::erase(left, choice.chosen.back().view);
  }
  return choice;
}

}  // namespace cnerf
