#include "src/train/luminance/view_cache.h"

#include <algorithm>
#include <cmath>
#include <deque>
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
constexpr std::size_t kPackedAtOnce = 3;            // views
constexpr std::size_t kPackedPixels = 1 << 21;      // of them: what was traced of a pixel takes some 150 bytes
constexpr std::size_t kRoom = 2 * kMostViewpoints;  // for a list of viewpoints, and for the next one beside it

/// Rays of a view as the engine traced them.
struct TracedRays {
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;  ///< [rays + 1]
};

/// A view of which all rays are traced: what is left to do needs no engine.
struct TracedView {
  CachedView view;  ///< without its arrays
  DirectionView sky;
  std::vector<TracedRays> pieces;  ///< of kRaysAtATime pixels each
};

CachedView resized_view(const UnitCamera& full_size_camera, int short_side) {
  CachedView view;
  view.camera = full_size_camera;
  const Intrinsics& lens = full_size_camera.intrinsics;
  const double factor = std::min(1.0, double(short_side) / std::min(lens.width, lens.height));
  view.width = std::max(1, int(std::lround(lens.width * factor)));
  view.height = std::max(1, int(std::lround(lens.height * factor)));
  view.camera.intrinsics = resized(lens, view.width, view.height);
  return view;
}

/// The engine's part of cache_view.
TracedView trace_view(const SeenScene& scene, const UnitCamera& full_size_camera, int short_side, double share,
                      const std::function<void(double fraction)>& report) {
  TracedView traced{resized_view(full_size_camera, short_side), scene.sky, {}};
  const CachedView& view = traced.view;
  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  for (std::size_t first = 0; first < pixels; first += kRaysAtATime) {
    std::vector<Ray> rays(std::min(kRaysAtATime, pixels - first));
    parallel_each(rays.size(), kGrain, [&](std::size_t r) { rays[r] = view.camera.ray_of_pixel(first + r); });
    auto& [samples, offsets] = traced.pieces.emplace_back();
    scene.engine.trace(rays, scene.march, {kCacheTransmittance, float(share)}, samples, offsets);
    if (report) report(double(first + rays.size()) / double(pixels));
  }
  return traced;
}

float brightest_of(const std::vector<TracedRays>& pieces) {
  std::vector<float> brightest(pieces.size(), 1e-6f);
  parallel_tasks(pieces.size(), [&](std::size_t i) {
    for (const WeightedSample& sample : pieces[i].samples) brightest[i] = std::max(brightest[i], sample.luminance);
  });
  return brightest.empty() ? 1 : *std::ranges::max_element(brightest);
}

/// Fills in the pixels and samples of a view that begin there.
void take_rays(const TracedRays& rays, std::size_t first_pixel, std::size_t first_sample, const DirectionView& sky,
               CachedView& view) {
  for (std::size_t r = 0; r + 1 < rays.offsets.size(); ++r) {
    const std::size_t p = first_pixel + r;
    for (std::size_t s = rays.offsets[r]; s < rays.offsets[r + 1]; ++s) {
      const WeightedSample& sample = rays.samples[s];
      view.luminance[p] += sample.weight * sample.luminance;
      view.opacity[p] += sample.weight;
      view.samples[first_sample + s] = {sample.t,
                                        std::uint16_t(std::lround(std::min(sample.weight, 1.0f) * kFullScale)),
                                        std::uint16_t(std::lround(sample.luminance / view.brightest * kFullScale))};
    }
    view.offsets[p + 1] = first_sample + rays.offsets[r + 1];
    if (sky.values != nullptr) view.luminance[p] += light_behind(sky, view.camera.ray_of_pixel(p), view.opacity[p]);
  }
}

/// The processor's part of cache_view.
CachedView packed_view(TracedView traced) {
  CachedView view = std::move(traced.view);
  const std::size_t pixels = std::size_t(view.width) * std::size_t(view.height);
  std::vector<std::size_t> first_samples = {0};
  for (const TracedRays& piece : traced.pieces) first_samples.push_back(first_samples.back() + piece.samples.size());
  view.luminance.resize(pixels);
  view.opacity.resize(pixels);
  view.offsets.resize(pixels + 1);
  view.samples.resize(first_samples.back());
  view.brightest = brightest_of(traced.pieces);
  parallel_tasks(traced.pieces.size(), [&](std::size_t i) {
    take_rays(traced.pieces[i], i * kRaysAtATime, first_samples[i], traced.sky, view);
  });
  return view;
}

cluster::Bytes packed(const CachedView& view) {
  cluster::Packer packer;
  packer.add(view.camera).add(view.width).add(view.height).add(view.brightest);
  packer.add(view.luminance).add(view.opacity).add(view.ignored);
  return packer.add(view.samples).add(view.offsets).packed();
}

CachedView unpacked(const cluster::Bytes& bytes) {
  CachedView view;
  cluster::Unpacker unpacker(bytes);
  unpacker.get(view.camera).get(view.width).get(view.height).get(view.brightest);
  unpacker.get(view.luminance).get(view.opacity).get(view.ignored).get(view.samples).get(view.offsets);
  return view;
}

}  // namespace

CachedView cache_view(const SeenScene& scene, const UnitCamera& full_size_camera, int short_side, double share,
                      const std::function<void(double fraction)>& report) {
  return packed_view(trace_view(scene, full_size_camera, short_side, share, report));
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
    return trace_view(scene, views[v].camera, short_side, kCachedWeight,
                      [&](double fraction) { report((double(v) + fraction) / double(views.size())); });
  };
  const auto packed_without_masked = [](TracedView&& one, const MonoImage& image) {
    CachedView view = packed_view(std::move(one));
    ignore_masked(view, image);
    return view;
  };
  if (ranks.is_alone())
    return fill_alone(views.size(), [&](std::size_t v) {
      return std::async(std::launch::async, packed_without_masked, traced(v), std::cref(*views[v].image));
    });
  while (views_.size() < views.size()) {  // one by each rank, until all have all
    const std::size_t first = views_.size(), own = first + std::size_t(ranks.rank());
    const std::size_t count = std::min(views.size() - first, std::size_t(ranks.size()));
    const std::vector<cluster::Bytes> all = ranks.gather(
        own < views.size() ? packed(packed_without_masked(traced(own), *views[own].image)) : cluster::Bytes());
    for (std::size_t i = 0; i < count; ++i) views_.push_back(unpacked(all[i]));
  }
}

/// Views are packed beside the engine's work on the next ones.
void ViewCache::fill_alone(std::size_t count, const std::function<std::future<CachedView>(std::size_t)>& begin_view) {
  const auto side = std::size_t(short_side_);
  const std::size_t at_once = std::clamp<std::size_t>(kPackedPixels / (side * side), 1, kPackedAtOnce);
  std::deque<std::future<CachedView>> packing;
  const auto take_first = [&] {
    views_.push_back(packing.front().get());
    packing.pop_front();
  };
  for (std::size_t v = views_.size(); v < count; ++v) {
    packing.push_back(begin_view(v));
    if (packing.size() >= at_once) take_first();
  }
  while (!packing.empty()) take_first();
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
  view.ignored.resize(view.opacity.size());
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    if (image.valid(i)) continue;
    const auto x = std::int64_t(i) % image.width, y = std::int64_t(i) / image.width;
    const auto column = std::size_t(x * view.width / image.width), row = std::size_t(y * view.height / image.height);
    const std::size_t pixel = row * std::size_t(view.width) + column;
    view.opacity[pixel] = 0;
    view.ignored[pixel] = 1;
  }
}

PixelSamples pixel_samples(std::span<const CachedView> views, std::span<const ViewPixel> wanted) {
  std::vector<std::size_t> offsets = {0};
  for (const auto& [v, p] : wanted) {
    offsets.push_back(offsets.back() + views[v].offsets[p + 1] - views[v].offsets[p]);
  }
  PixelSamples pixels = with_room_for(std::move(offsets));
  parallel_each(wanted.size(), kGrain, [&](std::size_t i) {
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
  });
  return pixels;
}

}  // namespace cnerf
