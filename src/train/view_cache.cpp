#include "src/train/view_cache.h"

#include <algorithm>
#include <cmath>

namespace cnerf {
namespace {

constexpr float kFullScale = 65535.0f;
constexpr float kCacheTransmittance = 2e-3f;  // what lies behind is not worth a sample

void pack(const std::vector<WeightedSample>& samples, CachedView& view) {
  view.brightest = 1e-6f;
  for (const WeightedSample& sample : samples) view.brightest = std::max(view.brightest, sample.luminance);
  view.samples.reserve(samples.size());
  for (const WeightedSample& sample : samples) {
    view.samples.push_back({sample.t, std::uint16_t(std::lround(std::min(sample.weight, 1.0f) * kFullScale)),
                            std::uint16_t(std::lround(sample.luminance / view.brightest * kFullScale))});
  }
}

}  // namespace

CachedView cache_view(const LuminanceEngine& engine, const MarchSettings& march, const UnitCamera& full_size_camera,
                      int short_side, double share) {
  CachedView view;
  view.camera = full_size_camera;
  const Intrinsics& lens = full_size_camera.intrinsics;
  const double factor = std::min(1.0, double(short_side) / std::min(lens.width, lens.height));
  view.width = std::max(1, int(std::lround(lens.width * factor)));
  view.height = std::max(1, int(std::lround(lens.height * factor)));
  view.camera.intrinsics = resized(lens, view.width, view.height);

  std::vector<Ray> rays;
  rays.reserve(std::size_t(view.width) * view.height);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) rays.push_back(view.camera.ray({x + 0.5, y + 0.5}));
  }
  std::vector<WeightedSample> samples;
  engine.trace(rays, march, {kCacheTransmittance, static_cast<float>(share)}, samples, view.offsets);
  view.luminance.resize(rays.size());
  view.opacity.resize(rays.size());
  for (std::size_t p = 0; p < rays.size(); ++p) {
    for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1]; ++s) {
      view.luminance[p] += samples[s].weight * samples[s].luminance;
      view.opacity[p] += samples[s].weight;
    }
  }
  pack(samples, view);
  return view;
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

PixelSamples pixel_samples(std::span<const Ray> rays, std::span<const WeightedSample> samples,
                           std::span<const std::size_t> offsets) {
  PixelSamples pixels;
  for (std::size_t r = 0; r < rays.size(); ++r) {
    for (std::size_t s = offsets[r]; s < offsets[r + 1]; ++s) {
      pixels.positions.push_back(rays[r].at(samples[s].t));
      pixels.weights.push_back(samples[s].weight);
      pixels.luminance.push_back(samples[s].luminance);
    }
    pixels.offsets.push_back(pixels.positions.size());
  }
  return pixels;
}

PixelSamples pixel_samples(const CachedView& view, std::span<const std::uint32_t> wanted) {
  PixelSamples pixels;
  for (const std::uint32_t p : wanted) {
    const Ray ray = view.camera.ray({p % std::uint32_t(view.width) + 0.5, p / std::uint32_t(view.width) + 0.5});
    for (std::size_t s = view.offsets[p]; s < view.offsets[p + 1]; ++s) {
      const CachedSample& sample = view.samples[s];
      pixels.positions.push_back(ray.at(sample.t));
      pixels.weights.push_back(float(sample.weight) / kFullScale);
      pixels.luminance.push_back(float(sample.luminance) / kFullScale * view.brightest);
    }
    pixels.offsets.push_back(pixels.positions.size());
  }
  return pixels;
}

void append(PixelSamples& to, const PixelSamples& more) {
  const std::size_t before = to.positions.size();
  to.positions.insert(to.positions.end(), more.positions.begin(), more.positions.end());
  to.weights.insert(to.weights.end(), more.weights.begin(), more.weights.end());
  to.luminance.insert(to.luminance.end(), more.luminance.begin(), more.luminance.end());
  for (std::size_t i = 1; i < more.offsets.size(); ++i) to.offsets.push_back(before + more.offsets[i]);
}

}  // namespace cnerf
