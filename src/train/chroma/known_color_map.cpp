#include "src/train/chroma/known_color_map.h"

#include <algorithm>
#include <cmath>

#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

constexpr float kSameDistance = 0.03f;   // of the distance: two views see the same surface
constexpr float kSameLightness = 15.0f;  // L*: and it looks the same

std::size_t view_named(const std::string& name, std::span<const std::string> names) {
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) throw UsageError("known colours: no training view is called " + name);
  return std::size_t(found - names.begin());
}

}  // namespace

/// Colours that a user gave, at the size of their view.
struct KnownColorMap::Source {
  std::size_t view;
  KnownColors colors;
};

/// What the view of a source sees of points that another view sees.
struct KnownColorMap::Sight {
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

KnownColorMap::KnownColorMap(std::span<const CachedView> views, std::span<const std::string> names,
                             std::span<const KnownColors> known) {
  if (known.empty()) return;
  std::vector<std::vector<float>> surfaces;
  for (const CachedView& view : views) surfaces.push_back(surface_distance(view));
  std::vector<Source> sources;
  for (const KnownColors& one : known) {
    const std::size_t view = view_named(one.view, names);
    KnownColors at_size = resized_to(one, views[view]);
    if (one.kind == KnownColorKind::kStrokes) at_size = spread(at_size, views[view], surfaces[view]);
    sources.push_back({view, std::move(at_size)});
    if (one.kind == KnownColorKind::kKeyFrame) add_key_frame(sources.back());
  }
  colors_.resize(views.size());
  parallel_tasks(views.size(), [&](std::size_t v) { colors_[v] = colors_seen_in(v, views, sources, surfaces); });
  list_places();
}

void KnownColorMap::add_key_frame(const Source& source) {
  KeyFrame frame{source.view, {}};
  for (const Ab& color : source.colors.ab) frame.ab.push_back(color.a);
  for (const Ab& color : source.colors.ab) frame.ab.push_back(color.b);
  key_frames_.push_back(std::move(frame));
}

/// Strokes correct what a key frame says, and of two the later: so the last source comes first.
KnownColorMap::ViewColors KnownColorMap::colors_seen_in(std::size_t v, std::span<const CachedView> views,
                                                        std::span<const Source> sources,
                                                        std::span<const std::vector<float>> surfaces) {
  const CachedView& view = views[v];
  const std::size_t pixels = view.opacity.size();
  ViewColors seen{std::vector<Ab>(pixels), std::vector<std::uint8_t>(pixels, 0)};
  std::vector<Sight> sights;
  for (const Source& source : sources) sights.emplace_back(views[source.view], surfaces[source.view]);
  for (std::size_t p = 0; p < pixels; ++p) {
    for (std::size_t s = sources.size(); s-- > 0 && seen.is_known[p] == 0;) {
      auto from = long(p);
      if (sources[s].view != v) {
        if (surfaces[v][p] <= 0) break;
        const Vec3f point = view.camera.ray_of_pixel(p).at(surfaces[v][p]);
        from = sights[s].pixel_of(point.cast<double>(), lightness_at(view, p));
      }
      if (from < 0 || sources[s].colors.is_known[std::size_t(from)] == 0) continue;
      seen.is_known[p] = 1;
      seen.ab[p] = sources[s].colors.ab[std::size_t(from)];
    }
  }
  return seen;
}

void KnownColorMap::list_places() {
  for (std::uint32_t v = 0; v < colors_.size(); ++v) {
    for (std::uint32_t p = 0; p < colors_[v].is_known.size(); ++p) {
      if (colors_[v].is_known[p] != 0) places_.push_back({v, p});
    }
  }
}

const Ab* KnownColorMap::find(std::size_t view, std::uint32_t pixel) const {
  if (colors_.empty() || colors_[view].is_known[pixel] == 0) return nullptr;
  return &colors_[view].ab[pixel];
}

}  // namespace cnerf
