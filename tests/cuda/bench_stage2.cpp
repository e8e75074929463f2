#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>

#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/engine/color_engines.h"
#include "src/train/luminance/view_cache.h"
#include "tests/cuda/check.h"
#include "tests/cuda/packed_capture.h"
#include "tests/support/random_pixels.h"

namespace cnerf::test {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds(const std::function<void()>& work) {
  const Clock::time_point start = Clock::now();
  work();
  return 1e3 * std::chrono::duration<double>(Clock::now() - start).count();
}
/// Of one call, after a first one that is not counted.
double median_milliseconds(int repetitions, const std::function<void()>& work) {
  work();
  std::vector<double> times;
  for (int i = 0; i < repetitions; ++i) times.push_back(milliseconds(work));
  std::nth_element(times.begin(), times.begin() + repetitions / 2, times.end());
  return times[std::size_t(repetitions / 2)];
}

/// Pixels of views that see something.
PixelSamples visible_pixels(const std::vector<CachedView>& views, int count, std::uint64_t seed) {
  SequentialRng rng(seed, 12);
  std::vector<ViewPixel> wanted;
  while (wanted.size() < std::size_t(count)) {
    const auto v = std::uint32_t(rng.uniform() * float(views.size()));
    const auto pixel = std::uint32_t(rng.uniform() * float(views[v].width * views[v].height));
    if (views[v].opacity[pixel] >= kLeastColoredOpacity) wanted.push_back({v, pixel});
  }
  return pixel_samples(views, wanted);
}
std::vector<SoftLabel> labels_of(const PixelSamples& pixels) {
  std::vector<SoftLabel> labels;
  for (const Ab& color : colors_of(pixels)) labels.push_back(soft_label(color));
  return labels;
}

void time_engines(const char* device, const PixelSamples& patch, const PixelSamples& distilled, ColorBinEngine& chroma,
                  ColorFieldEngine& chromaticity, int repetitions) {
  const std::vector<SoftLabel> labels = labels_of(patch);
  const std::vector<Ab> targets = colors_of(distilled);
  std::vector<Ab> colors(distilled.pixels());
  std::vector<Chromaticity> ratios(distilled.positions.size());
  std::printf("%s: step on %zu pixels %.3f ms", device, patch.pixels(),
              median_milliseconds(repetitions, [&] { chroma.step(patch, labels, {}, {}, 1e-3f); }));
  std::printf("  distillation step on %zu pixels %.3f ms", distilled.pixels(), median_milliseconds(repetitions, [&] {
                chromaticity.step(distilled, targets, {}, AbLoss::kHuber, 1e-3f);
              }));
  std::printf("  decoding them %.3f ms",
              median_milliseconds(repetitions, [&] { chroma.decode(distilled, 0.38f, colors); }));
  std::printf("  query of %zu points %.3f ms\n", ratios.size(),
              median_milliseconds(repetitions, [&] { chromaticity.query(distilled.positions, ratios); }));
  std::fflush(stdout);
}

/// All that stage 2 does but for asking a colorizer.
void time_stage2(const std::vector<CachedView>& views, const HashGridOptions& grid, int patches, int rays,
                 int distillation_steps) {
  const auto chroma = make_cuda_color_bin_engine(grid, 1);
  const auto chromaticity = make_cuda_color_field_engine(grid, 2);
  double loss = 0, distance = 0;
  const double injection = milliseconds([&] {
    for (int i = 0; i < patches; ++i) {
      const PixelSamples pixels = visible_pixels(views, rays, std::uint64_t(i));
      loss = chroma->step(pixels, labels_of(pixels), {}, {}, 1e-2f);
    }
  });
  const double distillation = milliseconds([&] {
    for (int i = 0; i < distillation_steps; ++i) {
      const PixelSamples pixels = visible_pixels(views, 2 * rays, std::uint64_t(i) << 32);
      std::vector<Ab> decoded(pixels.pixels());
      chroma->decode(pixels, 0.38f, decoded);
      distance = chromaticity->step(pixels, decoded, {}, AbLoss::kHuber, 1e-2f);
    }
  });
  std::printf("%d patches of %d pixels %.2f s (loss %.3f)  %d distillation steps %.2f s (ab distance %.3f)\n", patches,
              rays, 1e-3 * injection, loss, distillation_steps, 1e-3 * distillation, distance);
}

}  // namespace

int bench_stage2(const Arguments& arguments) {
  const PackedCapture packed = read_packed(arguments.text("capture", "."));
  const std::vector<TrainingView> views = training_views(packed.capture, packed.frame);
  const LuminanceEngineOptions options = engine_options(arguments, packed.frame.cascades);
  const auto luminance = make_cuda_luminance_engine(options);
  luminance->set_views(views);
  const int steps = int(arguments.number("steps", 3000));
  for (int i = 0; i < steps; ++i) {
    luminance->step(float(1e-2 * std::pow(0.05, std::max(0.0, 2.0 * i / steps - 1))));
  }
  wait_for(*luminance);

  std::vector<CachedView> cached;
  const int side = int(arguments.number("working_resolution", 384));
  const double caching = milliseconds([&] {
    for (const TrainingView& view : views) {
      cached.push_back(cache_view({*luminance, options.march}, view.camera, side, arguments.number("share", 0.99)));
    }
  });
  std::size_t pixels = 0, samples = 0;
  for (const CachedView& view : cached) pixels += view.luminance.size(), samples += view.samples.size();
  std::printf("%zu views of %dx%d cached in %.2f s: %.1f samples a pixel\n", cached.size(), cached.front().width,
              cached.front().height, 1e-3 * caching, double(samples) / double(pixels));

  HashGridOptions grid;
  grid.levels = int(arguments.number("chroma_levels", grid.levels));
  grid.log2_rows = int(arguments.number("chroma_log2_rows", grid.log2_rows));
  const int rays = int(arguments.number("rays", 4096));
  const PixelSamples patch = visible_pixels(cached, rays, 1), distilled = visible_pixels(cached, 2 * rays, 2);
  time_engines("CUDA", patch, distilled, *make_cuda_color_bin_engine(grid, 1), *make_cuda_color_field_engine(grid, 2),
               50);
  time_engines("CPU", patch, distilled, *make_cpu_color_bin_engine(grid, 1), *make_cpu_color_field_engine(grid, 2), 5);
  time_stage2(cached, grid, int(arguments.number("patches", 600)), rays, int(arguments.number("distill_steps", 1000)));
  return 0;
}

}  // namespace cnerf::test
