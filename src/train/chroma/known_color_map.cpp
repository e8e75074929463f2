#include "src/train/chroma/known_color_map.h"

#include <algorithm>
#include <cmath>

#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf {
namespace {

constexpr float kSameDistance = 0.03f;         // of the distance: two views see the same surface
constexpr float kKeyFrameCost = 1;             // a stroke corrects one as far as it reaches
constexpr float kSameLightness = 15.0f;        // L*: and it looks the same
constexpr std::size_t kPixelsPerPiece = 4096;  // of a parallel piece of work

}  // namespace

SeenSurfaces::SeenSurfaces(std::span<const CachedView> views, std::span<const std::string> names,
                           std::span<const Surface> surfaces)
    : views_(views), names_(names), surfaces_(surfaces.begin(), surfaces.end()) {
  const std::size_t known = surfaces.size();
  surfaces_.resize(views.size());
  parallel_tasks(views.size() - known, [&](std::size_t i) {
    surfaces_[known + i] = std::make_shared<const std::vector<float>>(surface_distance(views[known + i]));
  });
}

std::size_t SeenSurfaces::view_named(const std::string& name) const {
  const auto found = std::ranges::find(names_, name);
  if (found == names_.end()) throw UsageError("known colours: no training view or viewpoint is called " + name);
  return std::size_t(found - names_.begin());
}

Sight::Sight(const CachedView& view, std::span<const float> surface)
    : view_(view), surface_(surface), camera_from_unit_(view.camera.unit_from_camera.transposed()) {}

std::optional<std::size_t> Sight::pixel_of(Vec3d point, float lightness) const {
  const Vec3d from_camera = point - view_.camera.origin;
  const auto at = project(view_.camera.intrinsics, camera_from_unit_ * from_camera);
  if (!at || at->x < 0 || at->y < 0 || at->x >= view_.width || at->y >= view_.height) return {};
  const std::size_t pixel = std::size_t(at->y) * std::size_t(view_.width) + std::size_t(at->x);
  const double distance = length(from_camera);
  if (surface_[pixel] <= 0 || std::abs(distance - surface_[pixel]) > kSameDistance * distance) return {};
  if (std::abs(lightness_at(view_, pixel) - lightness) > kSameLightness) return {};
  return pixel;
}

KnownColorSources::KnownColorSources(const SeenSurfaces& seen, std::span<const KnownColors> known) : seen_(seen) {
  const bool everywhere = std::ranges::any_of(known, &KnownColors::everywhere);
  for (const KnownColors& one : known) {
    const std::size_t view = seen.view_named(one.view);
    RunningColors colors = running_colors(resized_to(one, seen.views()[view]));
    std::shared_ptr<const StrokesEverywhere> strokes;
    if (one.kind == KnownColorKind::kStrokes && everywhere) {
      strokes = std::make_shared<StrokesEverywhere>(colors, seen.views()[view], seen.surface(view));
    } else if (one.kind == KnownColorKind::kStrokes) {
      run(colors, seen.views()[view], seen.surface(view));
    } else {
      std::ranges::fill(colors.reach, 0.0f);
    }
    sources_.push_back({view, one.kind, std::move(colors), std::move(strokes)});
  }
}

bool KnownColorSources::is_everywhere() const {
  return std::ranges::any_of(sources_, [](const Source& source) { return source.everywhere != nullptr; });
}

/// What a painted view shows of a pixel, it claims; of what none shows, those claim by likeness that have samples.
/// Where there is only a sky, what was painted on it.
RunningColors KnownColorSources::everywhere_in(std::size_t v) const {
  const CachedView& view = seen_.views()[v];
  const PixelLooks looks(view, seen_.surface(v));
  const std::size_t pixels = view.opacity.size();
  RunningColors colors{std::vector<Ab>(pixels), std::vector<float>(pixels), std::vector<float>(pixels, kUnreached)};
  std::vector<Sight> sights;
  for (const Source& source : sources_) sights.emplace_back(seen_.views()[source.view], seen_.surface(source.view));
  std::vector<Claims> claims(pixels);
  std::vector<const Ab*> given(pixels, nullptr);
  const auto ask = [&](std::size_t p) {
    const Ray ray = view.camera.ray_of_pixel(p);
    const bool is_sky = view.opacity[p] < kLeastColoredOpacity;
    for (std::size_t s = sources_.size(); s-- > 0;) {
      const Source& source = sources_[s];
      std::optional<std::size_t> from = p;
      if (source.view != v) {
        if (looks.surface[p] <= 0) continue;
        const Vec3f point = ray.at(looks.surface[p]);
        from = sights[s].pixel_of(point.cast<double>(), lightness_at(view, p));
      }
      if (!from) continue;
      if (source.everywhere && !is_sky) {
        for (const Claims::Claim& claim : source.everywhere->claims()[*from].list) claims[p].add(claim);
      } else if (source.colors.is_known(*from) && given[p] == nullptr) {
        given[p] = &source.colors.ab[*from];
      }
    }
    const bool is_shown = is_sky || claims[p].cost() < kUnreached || given[p] != nullptr;
    for (std::size_t s = sources_.size(); s-- > 0 && !is_shown;) {
      if (sources_[s].everywhere) sources_[s].everywhere->claim_alike(ray, looks, p, claims[p]);
    }
  };
  const auto take = [&](std::size_t p) {
    const float lightness = lightness_at(view, p);
    if (given[p] != nullptr) claims[p].add({kKeyFrameCost, *given[p], lightness});
    colors.cost[p] = claims[p].cost();
    colors.ab[p] = claims[p].mixed(lightness);
  };
  // There are not always more views than threads.
  parallel_each(pixels, kPixelsPerPiece, ask);
  smooth(claims, view, looks.surface);
  parallel_each(pixels, kPixelsPerPiece, take);
  return colors;
}

/// The last source comes first.
RunningColors KnownColorSources::seen_in(std::size_t v) const {
  if (is_everywhere()) return everywhere_in(v);
  const CachedView& view = seen_.views()[v];
  const std::span<const float> surface = seen_.surface(v);
  const std::size_t pixels = view.opacity.size();
  RunningColors colors{std::vector<Ab>(pixels), std::vector<float>(pixels), std::vector<float>(pixels, kUnreached)};
  std::vector<Sight> sights;
  for (const Source& source : sources_) sights.emplace_back(seen_.views()[source.view], seen_.surface(source.view));
  for (std::size_t p = 0; p < pixels; ++p) {
    for (std::size_t s = sources_.size(); s-- > 0 && !colors.is_known(p);) {
      const RunningColors& given = sources_[s].colors;
      std::optional<std::size_t> from = p;
      if (sources_[s].view != v) {
        if (surface[p] <= 0) continue;
        const Vec3f point = view.camera.ray_of_pixel(p).at(surface[p]);
        from = sights[s].pixel_of(point.cast<double>(), lightness_at(view, p));
      }
      if (!from || !given.is_known(*from)) continue;
      colors.cost[p] = given.cost[*from];
      colors.reach[p] = given.reach[*from];
      colors.ab[p] = given.ab[*from];
    }
  }
  run(colors, view, surface);
  return colors;
}

KnownColorMap::KnownColorMap(const SeenSurfaces& seen, const KnownColorSources& sources) {
  if (sources.sources().empty()) return;
  for (const KnownColorSources::Source& source : sources.sources()) {
    if (source.kind == KnownColorKind::kKeyFrame) add_key_frame(source);
  }
  colors_.resize(seen.views().size());
  parallel_tasks(colors_.size(),
                 [&](std::size_t v) { colors_[v] = std::make_shared<const RunningColors>(sources.seen_in(v)); });
  list_places();
}

KnownColorMap::KnownColorMap(std::vector<OfView> colors) : colors_(std::move(colors)) {
  list_places();
}

void KnownColorMap::add_key_frame(const KnownColorSources::Source& source) {
  KeyFrame frame{source.view, {}};
  for (const Ab& color : source.colors.ab) frame.ab.push_back(color.a);
  for (const Ab& color : source.colors.ab) frame.ab.push_back(color.b);
  key_frames_.push_back(std::move(frame));
}

void KnownColorMap::list_places() {
  std::vector<std::vector<ViewPixel>> of_views(colors_.size());
  parallel_tasks(colors_.size(), [&](std::size_t v) {
    const RunningColors& of_view = *colors_[v];
    for (std::uint32_t p = 0; p < of_view.cost.size(); ++p) {
      if (of_view.is_known(p)) of_views[v].push_back({std::uint32_t(v), p});
    }
  });
  for (const auto& places : of_views) places_.insert(places_.end(), places.begin(), places.end());
}

const Ab* KnownColorMap::find(std::size_t view, std::uint32_t pixel) const {
  if (colors_.empty() || !colors_[view]->is_known(pixel)) return nullptr;
  return &colors_[view]->ab[pixel];
}

KnownColorMap known_color_map(std::span<const CachedView> views, std::span<const std::string> names,
                              std::span<const KnownColors> known) {
  if (known.empty()) return KnownColorMap();
  const SeenSurfaces seen(views, names);
  return {seen, KnownColorSources(seen, known)};
}

}  // namespace cnerf
