#include "src/studio/field_view.h"

#include <algorithm>

#include "src/base/parallel.h"

namespace cnerf::studio {
namespace {

constexpr std::size_t kGrain = 256;       // rays of a parallel piece of work
constexpr std::size_t kLeastRays = 8192;  // between two questions whether to go on

PixelSamples seen_by(std::span<const Ray> rays, const LuminanceEngine& engine, const MarchSettings& march,
                     const RenderEffort& effort) {
  std::vector<WeightedSample> samples;
  std::vector<std::size_t> offsets;
  engine.trace(rays, march, effort, samples, offsets);
  return pixel_samples(rays, samples, offsets);
}

std::vector<float> light_of(std::span<const Ray> rays, const LuminanceEngine& engine, const MarchSettings& march,
                            const RenderEffort& effort) {
  std::vector<RayResult> results(rays.size());
  engine.render(rays, march, effort, results);
  std::vector<float> light;
  for (const RayResult& result : results) light.push_back(result.luminance);
  return light;
}

/// Colours at their luminance, from the pixel `first` on.
void put(std::span<const float> luminance, const std::vector<Ab>& colors, const Finish& finish, std::size_t first,
         Picture& picture) {
  parallel_ranges(colors.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f rgb = linear_rgb_at(finish.gain() * luminance[i], finish.of(colors[i]));
      for (int c = 0; c < 3; ++c) picture.rgb[3 * (first + i) + std::size_t(c)] = srgb8_from_linear(rgb[c]);
    }
  });
}

Picture blank(int width, int height) {
  return {width, height, std::vector<std::uint8_t>(3 * std::size_t(width) * std::size_t(height))};
}

}  // namespace

std::vector<Picture> draw_field(const LuminanceModel& luminance, const FieldCamera& camera, std::span<const Side> sides,
                                const DrawingEffort& effort, const std::function<bool()>& keep_going) {
  const UnitCamera unit(camera.lens, camera.world_from_camera, luminance.frame);
  const std::size_t count = std::size_t(camera.lens.width) * std::size_t(camera.lens.height);
  std::vector<Picture> pictures(sides.size(), blank(camera.lens.width, camera.lens.height));
  const bool is_grey = std::ranges::all_of(sides, [](Side side) { return side == nullptr; });
  const MarchSettings march = luminance.march(effort.steps_per_box);
  // Without colour a GPU hands back a number per ray, and likes many; with it, samples.
  const std::size_t at_a_time = is_grey ? std::max(kLeastRays, luminance.engine->points_at_a_time() / 8) : kLeastRays;
  for (std::size_t first = 0; first < count; first += at_a_time) {
    if (!keep_going()) return {};
    std::vector<Ray> rays(std::min(at_a_time, count - first));
    parallel_ranges(rays.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) rays[r] = unit.ray_of_pixel(first + r);
    });
    const PixelSamples pixels = is_grey ? PixelSamples{} : seen_by(rays, *luminance.engine, march, effort.rays);
    const std::vector<float> light =
        is_grey ? light_of(rays, *luminance.engine, march, effort.rays) : pixel_luminance(pixels);
    for (std::size_t s = 0; s < sides.size(); ++s) {
      put(light, sides[s] != nullptr ? sides[s]->decode(pixels) : std::vector<Ab>(rays.size()), effort.finish, first,
          pictures[s]);
    }
  }
  return pictures;
}

Picture draw_cached(const CachedView& view, Side side, int width, const Finish& finish) {
  const int step = std::max(1, (view.width + width - 1) / width);
  Picture picture = blank(std::max(view.width / step, 1), std::max(view.height / step, 1));
  std::vector<ViewPixel> places;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const int column = std::min(x * step + step / 2, view.width - 1);
      const int row = std::min(y * step + step / 2, view.height - 1);
      places.push_back({0, std::uint32_t(row * view.width + column)});
    }
  }
  std::vector<float> light;
  for (const ViewPixel& place : places) light.push_back(view.luminance[place.pixel]);
  put(light, side != nullptr ? side->decode(pixel_samples(std::span(&view, 1), places)) : std::vector<Ab>(light.size()),
      finish, 0, picture);
  return picture;
}

}  // namespace cnerf::studio
