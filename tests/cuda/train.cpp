#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "src/color/colorspace_math.h"
#include "src/engine/cuda/luminance_engine_cuda.h"
#include "tests/cuda/check.h"
#include "tests/cuda/packed_capture.h"

namespace cnerf::test {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Mean dB of the held-out views (decision 1 of docs/decisions.md).
double held_out_psnr(const PackedCapture& packed, const LuminanceEngineCuda& engine, const MarchSettings& march,
                     double min_transmittance, double thickness = 0) {
  double total = 0;
  int views = 0;
  for (const View& view : packed.capture.views) {
    if (!view.held_out) continue;
    const UnitCamera camera(view.intrinsics, view.world_from_camera, packed.frame);
    std::vector<RayResult> results(view.image.pixel_count());
    engine.render_view(camera, march, float(min_transmittance), results, float(thickness));
    double squared = 0;
    for (std::size_t p = 0; p < results.size(); ++p) {
      const float seen = srgb_from_linear(std::clamp(results[p].luminance, 0.0f, 1.0f));
      const float truth = srgb_from_linear(std::clamp(view.image.luminance(p), 0.0f, 1.0f));
      squared += (seen - truth) * (seen - truth);
    }
    total += -10 * std::log10(std::max(squared / double(results.size()), 1e-10));
    ++views;
  }
  return views > 0 ? total / views : 0;
}

/// @param near  unit space; what is nearer to a camera is empty as well
void exclude(const PackedCapture& packed, LuminanceEngineCuda& engine, const OccupancyOptions& options, double near) {
  const OccupancyLayout layout(options.resolution, packed.frame.cascades);
  const std::vector<TrainingView> views = training_views(packed.capture, packed.frame);
  engine.exclude([&](Vec3f centre, float radius) {
    for (const TrainingView& view : views) {
      if (length(view.camera.origin - centre.cast<double>()) + radius < near) return false;
    }
    // Blocks of cells are asked for by their sphere; its radius tells the cascade.
    int cascade = 0;
    while (cascade + 1 < layout.cascades && radius > 3.5f * layout.cell_side(cascade)) ++cascade;
    return packed.excluded[layout.cell_of(cascade, centre)] == 0;
  });
}

}  // namespace

int train(const Arguments& arguments) {
  const PackedCapture packed = read_packed(arguments.text("capture", "."));
  const std::vector<TrainingView> views = training_views(packed.capture, packed.frame);
  const double seconds = arguments.number("seconds", 10), rate = arguments.number("rate", 1e-2);
  const double final_rate = arguments.number("final_rate", 5e-4), hold = arguments.number("hold", 0.5);
  std::vector<double> report_at;
  for (const double t : {1.0, 2.0, 5.0, 10.0, 30.0}) {
    if (t <= seconds) report_at.push_back(t);
  }
  for (int seed = 1; seed <= int(arguments.number("seeds", 1)); ++seed) {
    LuminanceEngineOptions options = engine_options(arguments, packed.frame.cascades);
    options.seed = std::uint64_t(seed);
    LuminanceEngineCuda engine(options);
    exclude(packed, engine, options.occupancy, arguments.number("near", 0));
    double elapsed = 0;
    std::size_t next = 0;
    StepReport report;
    double trained = 0, marched = 0, rays = 0;
    std::printf("seed %d:", seed);
    while (next < report_at.size()) {
      const Clock::time_point start = Clock::now();
      while (elapsed + seconds_since(start) < report_at[next]) {
        const double fraction = (elapsed + seconds_since(start)) / seconds;
        const double decay = std::clamp((fraction - hold) / (1 - hold), 0.0, 1.0);
        report = engine.step(views, float(rate * std::pow(final_rate / rate, decay)));
        trained += double(report.trained_samples);
        marched += double(report.marched_samples);
        rays += double(report.rays);
      }
      engine.finish();
      elapsed += seconds_since(start);
      std::printf("  %.0f s %ld steps %.2f dB", report_at[next], engine.step_count(),
                  held_out_psnr(packed, engine, options.march, arguments.number("min_transmittance", 1e-3)));
      std::fflush(stdout);
      ++next;
    }
    std::printf("  | %.0f steps/s, %.0f rays a step, %.1f samples a ray, %.2f marched, %.0f MiB, occupied %.4f\n",
                double(engine.step_count()) / elapsed, rays / double(engine.step_count()), trained / rays,
                marched / trained, double(engine.device_bytes()) / (1 << 20), engine.occupancy().occupied_share());
  }
  return 0;
}

int bench(const Arguments& arguments) {
  const PackedCapture packed = read_packed(arguments.text("capture", "."));
  const std::vector<TrainingView> views = training_views(packed.capture, packed.frame);
  const LuminanceEngineOptions options = engine_options(arguments, packed.frame.cascades);
  const Clock::time_point made = Clock::now();
  LuminanceEngineCuda engine(options);
  exclude(packed, engine, options.occupancy, arguments.number("near", 0));
  std::printf("set up in %.2f s, %.0f MiB without images\n", seconds_since(made), double(engine.device_bytes()) / (1 << 20));
  const int steps = int(arguments.number("steps", 1000));
  for (int i = 0; i < steps; ++i) engine.step(views, float(1e-2 * std::pow(0.05, std::max(0.0, 2.0 * i / steps - 1))));
  const StepReport report = engine.finish();
  const Clock::time_point start = Clock::now();
  constexpr int kTimed = 320;
  for (int i = 0; i < kTimed; ++i) engine.step(views, 5e-4f);
  engine.finish();
  const double per_step = 1e3 * seconds_since(start) / kTimed;
  std::printf("after %d steps: %zu rays, %zu marched, %zu trained, loss %.5f, occupied %.4f, %.0f MiB\n", steps,
              report.rays, report.marched_samples, report.trained_samples, report.loss,
              engine.occupancy().occupied_share(), double(engine.device_bytes()) / (1 << 20));
  std::printf("step %.3f ms = %.0f steps/s\n", per_step, 1e3 / per_step);
  const CudaStepTimes t = engine.time_parts(views, 50);
  std::printf(
      "ms a step: draw %.4f  trace %.4f  nets backward %.4f  nets update %.4f  grid backward %.4f  table update %.4f  "
      "occupancy (every 16) %.4f\n",
      t.draw, t.trace, t.nets_backward, t.nets_update, t.grid_backward, t.table_update, t.occupancy);

  for (const double thickness : {0.0, 0.05, 0.1, 0.2, 0.4, 0.8}) {
    for (const double min_transmittance : {1e-3, 1e-2, 3e-2}) {
      const double psnr = held_out_psnr(packed, engine, options.march, min_transmittance, thickness);
      const View& view = packed.capture.views.front();
      const UnitCamera camera(view.intrinsics, view.world_from_camera, packed.frame);
      const Clock::time_point begin = Clock::now();
      for (int i = 0; i < 5; ++i) {
        engine.render_view(camera, options.march, float(min_transmittance), {}, float(thickness));
      }
      std::printf("render cells of thickness %.2f to transmittance %.0e: %.3f dB, %.2f ms\n", thickness,
                  min_transmittance, psnr, 1e3 * seconds_since(begin) / 5);
    }
  }
  const View& view = packed.capture.views.front();
  const UnitCamera camera(view.intrinsics, view.world_from_camera, packed.frame);
  std::vector<RayResult> results(view.image.pixel_count());
  for (const double min_transmittance : {1e-4, 1e-3, 1e-2}) {
    double times[2] = {1e9, 1e9};
    for (int i = 0; i < 10; ++i) {
      Clock::time_point begin = Clock::now();
      engine.render_view(camera, options.march, float(min_transmittance), {});
      times[0] = std::min(times[0], 1e3 * seconds_since(begin));
      begin = Clock::now();
      engine.render_view(camera, options.march, float(min_transmittance), results);
      times[1] = std::min(times[1], 1e3 * seconds_since(begin));
    }
    std::printf("render %dx%d to transmittance %.0e: %.2f ms on the GPU, %.2f ms with the download\n", view.image.width,
                view.image.height, min_transmittance, times[0], times[1]);
  }
  return 0;
}

}  // namespace cnerf::test
