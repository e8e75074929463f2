#include "src/train/known_colors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
namespace {

constexpr float kSolidOpacity = 0.5f;    // less of a pixel shows no surface
constexpr float kSameDistance = 0.03f;   // of the distance: two views see the same surface
constexpr float kSameLightness = 15.0f;  // L*: and it looks the same

float lightness_at(const CachedView& view, std::size_t pixel) {
  return std::clamp(lightness_from_luminance(view.luminance[pixel]), 0.0f, 100.0f);
}

/// At the size of a cached view; a pixel is known where most of what it covers is, and has the mean of that.
KnownColors resized_to(const KnownColors& known, const CachedView& view) {
  KnownColors out{known.kind, known.view, view.width, view.height, {}, {}};
  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  std::vector<double> sum(2 * pixels), count(pixels), all(pixels);
  const auto add = [&](int from_x, int from_y, int x, int y) {
    const std::size_t to = std::size_t(y) * std::size_t(view.width) + std::size_t(x);
    const std::size_t from = std::size_t(from_y) * std::size_t(known.width) + std::size_t(from_x);
    all[to] += 1;
    if (known.is_known[from] == 0) return;
    count[to] += 1;
    sum[2 * to] += known.ab[from].a;
    sum[2 * to + 1] += known.ab[from].b;
  };
  // Every pixel of the larger of the two images belongs to one of the smaller.
  const auto of = [](int i, int from, int to) { return std::min(int((i + 0.5) * to / from), to - 1); };
  for (int y = 0; y < std::max(known.height, view.height); ++y) {
    for (int x = 0; x < std::max(known.width, view.width); ++x) {
      const bool shrinks_x = known.width > view.width, shrinks_y = known.height > view.height;
      add(shrinks_x ? x : of(x, view.width, known.width), shrinks_y ? y : of(y, view.height, known.height),
          shrinks_x ? of(x, known.width, view.width) : x, shrinks_y ? of(y, known.height, view.height) : y);
    }
  }
  for (std::size_t p = 0; p < pixels; ++p) {
    out.is_known.push_back(count[p] > 0 && 2 * count[p] >= all[p] ? 1 : 0);
    out.ab.push_back(out.is_known[p] != 0 ? Ab{float(sum[2 * p] / count[p]), float(sum[2 * p + 1] / count[p])} : Ab{});
  }
  return out;
}

/// Whether a point that another view sees at `pixel` is what `source` sees; if so, where.
struct Sight {
  const CachedView& source;
  std::span<const float> surface;  // of the source
  Mat3d camera_from_unit;

  Sight(const CachedView& view, std::span<const float> of_source)
      : source(view), surface(of_source), camera_from_unit(view.camera.unit_from_camera.transposed()) {}

  [[nodiscard]] long pixel_of(Vec3d point, float lightness) const {
    const Vec3d from_camera = point - source.camera.origin;
    const auto at = project(source.camera.intrinsics, camera_from_unit * from_camera);
    if (!at || at->x < 0 || at->y < 0 || at->x >= source.width || at->y >= source.height) return -1;
    const std::size_t pixel = std::size_t(at->y) * std::size_t(source.width) + std::size_t(at->x);
    const double distance = length(from_camera);
    if (surface[pixel] <= 0 || std::abs(distance - surface[pixel]) > kSameDistance * distance) return -1;
    return std::abs(lightness_at(source, pixel) - lightness) <= kSameLightness ? long(pixel) : -1;
  }
};

std::size_t view_named(const std::string& name, std::span<const std::string> names) {
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) throw UsageError("known colours: no training view is called " + name);
  return std::size_t(found - names.begin());
}

}  // namespace

std::string describe(std::span<const KnownColors> known) {
  std::string text;
  for (const KnownColors& one : known) {
    std::string content(reinterpret_cast<const char*>(one.is_known.data()), one.is_known.size());
    content.append(reinterpret_cast<const char*>(one.ab.data()), one.ab.size() * sizeof(Ab));
    text += one.kind == KnownColorKind::kKeyFrame ? " + key frame " : " + hints on ";
    text += one.view + " (" + sha256(std::as_bytes(std::span(content))).substr(0, 8) + ")";
  }
  return text;
}

std::vector<float> surface_distance(const CachedView& view) {
  std::vector<float> surface(view.opacity.size(), 0.0f);
  for (std::size_t p = 0; p < surface.size(); ++p) {
    if (view.opacity[p] < kSolidOpacity) continue;
    double total = 0, passed = 0;
    for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1]; ++s) total += view.samples[s].weight;
    for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1] && 2 * passed < total; ++s) {
      passed += view.samples[s].weight;
      surface[p] = view.samples[s].t;
    }
  }
  return surface;
}

KnownColors spread(const KnownColors& strokes, const CachedView& view, std::span<const float> surface,
                   const StrokeReach& reach) {
  CNERF_CHECK(strokes.width == view.width && strokes.height == view.height, "strokes of the view's size");
  KnownColors out = strokes;
  std::vector<float> cost(out.ab.size(), std::numeric_limits<float>::infinity());
  using Entry = std::pair<float, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  for (std::uint32_t p = 0; p < cost.size(); ++p) {
    if (strokes.is_known[p] == 0) continue;
    cost[p] = 0;
    open.emplace(0.0f, p);
  }
  const float one_pixel = 1.0f / (reach.share_of_short_side * float(view.short_side()));
  while (!open.empty()) {
    const auto [so_far, p] = open.top();
    open.pop();
    if (so_far > cost[p]) continue;
    out.is_known[p] = 1;
    const int x = int(p) % view.width, y = int(p) / view.width;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int nx = x + dx, ny = y + dy;
        if ((dx == 0 && dy == 0) || nx < 0 || ny < 0 || nx >= view.width || ny >= view.height) continue;
        const auto q = std::uint32_t(ny * view.width + nx);
        if (surface[p] <= 0 || surface[q] <= 0) continue;
        const float step = one_pixel * std::hypot(float(dx), float(dy)) +
                           std::abs(lightness_at(view, p) - lightness_at(view, q)) / reach.lightness +
                           std::abs(std::log(surface[q] / surface[p])) / reach.depth;
        if (so_far + step >= std::min(cost[q], 1.0f)) continue;
        cost[q] = so_far + step;
        out.ab[q] = out.ab[p];
        open.emplace(cost[q], q);
      }
    }
  }
  return out;
}

KnownColorMap::KnownColorMap(const std::vector<CachedView>& views, std::span<const std::string> names,
                             std::span<const KnownColors> known)
    : ab_(views.size()), is_known_(views.size()) {
  if (known.empty()) return;
  std::vector<KnownColors> sources;
  std::vector<std::size_t> source_views;
  std::vector<std::vector<float>> surfaces;
  for (const CachedView& view : views) surfaces.push_back(surface_distance(view));
  for (const KnownColors& one : known) {
    const std::size_t view = view_named(one.view, names);
    KnownColors at_size = resized_to(one, views[view]);
    if (one.kind == KnownColorKind::kStrokes) at_size = spread(at_size, views[view], surfaces[view]);
    if (one.kind == KnownColorKind::kKeyFrame) {
      KeyFrame frame{view, {}};
      for (const Ab& color : at_size.ab) frame.ab.push_back(color.a);
      for (const Ab& color : at_size.ab) frame.ab.push_back(color.b);
      key_frames_.push_back(std::move(frame));
    }
    source_views.push_back(view);
    sources.push_back(std::move(at_size));
  }
  // Strokes correct what a key frame says, and of two the later: so the last source comes first.
  parallel_tasks(views.size(), [&](std::size_t v) {
    const CachedView& view = views[v];
    ab_[v].resize(view.opacity.size());
    is_known_[v].assign(view.opacity.size(), 0);
    std::vector<Sight> sights;
    for (const std::size_t source : source_views) sights.emplace_back(views[source], surfaces[source]);
    for (std::size_t p = 0; p < view.opacity.size(); ++p) {
      for (std::size_t s = sources.size(); s-- > 0 && is_known_[v][p] == 0;) {
        auto from = long(p);
        if (source_views[s] != v) {
          if (surfaces[v][p] <= 0) break;
          const Ray ray =
              view.camera.ray({double(p % std::size_t(view.width)) + 0.5, double(p / std::size_t(view.width)) + 0.5});
          from = sights[s].pixel_of(ray.at(surfaces[v][p]).cast<double>(), lightness_at(view, p));
        }
        if (from < 0 || sources[s].is_known[std::size_t(from)] == 0) continue;
        is_known_[v][p] = 1;
        ab_[v][p] = sources[s].ab[std::size_t(from)];
      }
    }
  });
  for (std::uint32_t v = 0; v < views.size(); ++v) {
    for (std::uint32_t p = 0; p < is_known_[v].size(); ++p) {
      if (is_known_[v][p] != 0) places_.push_back({v, p});
    }
  }
}

const Ab* KnownColorMap::find(std::size_t view, std::uint32_t pixel) const {
  if (is_known_.empty() || is_known_[view].empty() || is_known_[view][pixel] == 0) return nullptr;
  return &ab_[view][pixel];
}

}  // namespace cnerf
