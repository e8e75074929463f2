#include "src/train/luminance/view_cache.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "src/base/check.h"
#include "src/base/error.h"
#include "src/base/parallel.h"
#include "src/cluster/packing.h"

namespace cnerf {
namespace {

constexpr float kFullScale = 65535.0f;
constexpr float kCacheTransmittance = 2e-3f;        // what lies behind is not worth a sample
constexpr std::size_t kRaysAtATime = 1 << 15;       // a tenth of a second of two cores; a GPU wants many
constexpr std::size_t kGrain = 512;                 // pixels of a parallel piece of work
constexpr std::size_t kRoom = 2 * kMostViewpoints;  // for a list of viewpoints, and for the next one beside it

void pack(const std::vector<WeightedSample>& samples, CachedView& view) {
  view.brightest = 1e-6f;
  for (const WeightedSample& sample : samples) view.brightest = std::max(view.brightest, sample.luminance);
  view.samples.resize(samples.size());
  parallel_ranges(samples.size(), 16 * kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      view.samples[s] = {samples[s].t, std::uint16_t(std::lround(std::min(samples[s].weight, 1.0f) * kFullScale)),
                         std::uint16_t(std::lround(samples[s].luminance / view.brightest * kFullScale))};
    }
  });
}

cluster::Bytes packed(const CachedView& view) {
  cluster::Packer packer;
  packer.add(view.camera).add(view.width).add(view.height).add(view.brightest);
  return packer.add(view.luminance).add(view.opacity).add(view.samples).add(view.offsets).packed();
}

CachedView unpacked(const cluster::Bytes& bytes) {
  CachedView view;
  cluster::Unpacker unpacker(bytes);
  unpacker.get(view.camera).get(view.width).get(view.height).get(view.brightest);
  unpacker.get(view.luminance).get(view.opacity).get(view.samples).get(view.offsets);
  return view;
}

}  // namespace

CachedView cache_view(const SeenScene& scene, const UnitCamera& full_size_camera, int short_side, double share,
                      const std::function<void(double fraction)>& report) {
  CachedView view;
  view.camera = full_size_camera;
  const Intrinsics& lens = full_size_camera.intrinsics;
  const double factor = std::min(1.0, double(short_side) / std::min(lens.width, lens.height));
  view.width = std::max(1, int(std::lround(lens.width * factor)));
  view.height = std::max(1, int(std::lround(lens.height * factor)));
  view.camera.intrinsics = resized(lens, view.width, view.height);

  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  std::vector<WeightedSample> samples, some;
  std::vector<std::size_t> offsets;
  view.offsets = {0};
  for (std::size_t first = 0; first < pixels; first += kRaysAtATime) {
    std::vector<Ray> rays(std::min(kRaysAtATime, pixels - first));
    parallel_ranges(rays.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) rays[r] = view.camera.ray_of_pixel(first + r);
    });
    scene.engine.trace(rays, scene.march, {kCacheTransmittance, float(share)}, some, offsets);
    for (std::size_t r = 0; r < rays.size(); ++r) view.offsets.push_back(samples.size() + offsets[r + 1]);
    samples.insert(samples.end(), some.begin(), some.end());
    if (report) report(double(first + rays.size()) / double(pixels));
  }
  view.luminance.resize(pixels);
  view.opacity.resize(pixels);
  parallel_ranges(pixels, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1]; ++s) {
        view.luminance[p] += samples[s].weight * samples[s].luminance;
        view.opacity[p] += samples[s].weight;
      }
      if (scene.sky.values != nullptr) {
        view.luminance[p] += light_behind(scene.sky, view.camera.ray_of_pixel(p), view.opacity[p]);
      }
    }
  });
  pack(samples, view);
  return view;
}

void ViewCache::fill(const SeenScene& scene, const Capture& capture, const SceneFrame& frame, int short_side,
                     const std::function<void(double fraction)>& report) {
  const std::vector<TrainingView> views = training_views(capture, frame);
  if (views.empty()) throw UsageError("capture.holdout: holds out every view; none is left to colorize");
  cluster::Ranks& ranks = *ranks_;
  if (short_side != short_side_) *this = ViewCache();
  trace_with(ranks);
  short_side_ = short_side;
  if (names_.empty()) {
    views_.reserve(views.size() + kRoom);
    names_.reserve(views.size() + kRoom);
    for (const View& view : capture.views) {
      if (!view.held_out) names_.push_back(view.name);
    }
  }
  const auto traced = [&](std::size_t v) {
    return cache_view(scene, views[v].camera, short_side, kCachedWeight,
                      [&](double fraction) { report((double(v) + fraction) / double(views.size())); });
  };
  while (views_.size() < views.size()) {  // one by each rank, until all have all
    const std::size_t first = views_.size(), own = first + std::size_t(ranks.rank());
    const std::size_t count = std::min(views.size() - first, std::size_t(ranks.size()));
    if (ranks.is_alone()) {
      views_.push_back(traced(own));
    } else {
      const std::vector<cluster::Bytes> all = ranks.gather(own < views.size() ? packed(traced(own)) : cluster::Bytes());
      for (std::size_t i = 0; i < count; ++i) views_.push_back(unpacked(all[i]));
    }
    for (std::size_t v = first; v < first + count; ++v) ignore_masked(views_[v], *views[v].image);
  }
}

std::vector<ViewCache::TracedViewpoint> ViewCache::traced(const SeenScene& scene, const SceneFrame& frame,
                                                          std::span<const Viewpoint> viewpoints,
                                                          const std::function<void(double fraction)>& report) const {
  std::vector<Viewpoint> missing;
  std::ranges::copy_if(viewpoints, std::back_inserter(missing), [this](const Viewpoint& one) { return !holds(one); });
  std::vector<TracedViewpoint> traced;
  for (const Viewpoint& viewpoint : missing) {
    const UnitCamera camera(viewpoint.camera.intrinsics(), viewpoint.camera.world_from_camera(), frame);
    traced.push_back({viewpoint, cache_view(scene, camera, short_side_, kCachedWeight, [&](double fraction) {
                        if (report) report((double(traced.size()) + fraction) / double(missing.size()));
                      })});
  }
  return traced;
}

std::size_t ViewCache::place_of(const Viewpoint& viewpoint) const {
  return of_capture() + std::size_t(std::ranges::find(viewpoints_, viewpoint) - viewpoints_.begin());
}

void ViewCache::add(std::vector<TracedViewpoint>&& traced) {
  for (auto& [viewpoint, view] : traced) {
    if (holds(viewpoint) || viewpoints_.size() == kRoom) continue;
    const auto older = std::ranges::find(viewpoints_, viewpoint.name, &Viewpoint::name);
    if (older != viewpoints_.end()) {
      names_[place_of(*older)].clear();
      older->name.clear();
    }
    views_.push_back(std::move(view));
    names_.push_back(viewpoint.name);
    viewpoints_.push_back(std::move(viewpoint));
  }
}

void ViewCache::put_first(std::span<const Viewpoint> viewpoints) {
  const std::size_t first = of_capture();
  for (std::size_t i = 0; i < viewpoints.size(); ++i) {
    const std::size_t from = place_of(viewpoints[i]), to = first + i;
    CNERF_CHECK(from < names_.size() && to <= from, "viewpoints that are held, each once");
    std::swap(views_[to], views_[from]);
    std::swap(names_[to], names_[from]);
    std::swap(viewpoints_[i], viewpoints_[from - first]);
  }
}

void ViewCache::keep_only(std::span<const Viewpoint> viewpoints) {
  std::vector<Viewpoint> kept;
  std::ranges::copy_if(viewpoints, std::back_inserter(kept), [this](const Viewpoint& one) { return holds(one); });
  put_first(kept);
  const std::size_t count = of_capture() + kept.size();
  views_.resize(count);
  names_.resize(count);
  viewpoints_.resize(kept.size());
}

void ignore_masked(CachedView& view, const MonoImage& image) {
  if (image.mask.empty()) return;
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    if (image.valid(i)) continue;
    const auto x = std::int64_t(i) % image.width, y = std::int64_t(i) / image.width;
    const auto column = std::size_t(x * view.width / image.width), row = std::size_t(y * view.height / image.height);
    view.opacity[row * std::size_t(view.width) + column] = 0;
  }
}

PixelSamples pixel_samples(std::span<const CachedView> views, std::span<const ViewPixel> wanted) {
  std::vector<std::size_t> offsets = {0};
  for (const auto& [v, p] : wanted) {
    offsets.push_back(offsets.back() + views[v].offsets[p + 1] - views[v].offsets[p]);
  }
  PixelSamples pixels = with_room_for(std::move(offsets));
  parallel_ranges(wanted.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const CachedView& view = views[wanted[i].view];
      const std::uint32_t p = wanted[i].pixel;
      const Ray ray = view.camera.ray_of_pixel(p);
      std::size_t at = pixels.offsets[i];
      for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1]; ++s, ++at) {
        const CachedSample& sample = view.samples[s];
        pixels.positions[at] = ray.at(sample.t);
        pixels.weights[at] = float(sample.weight) / kFullScale;
        pixels.luminance[at] = float(sample.luminance) / kFullScale * view.brightest;
      }
    }
  });
  return pixels;
}

}  // namespace cnerf
