#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "src/base/cuda/device_memory.h"

#include "src/train/luminance/depth_hints.h"
#include "tests/cuda/check.h"
#include "tests/cuda/packed_capture.h"
#include "tests/support/disturbed_capture.h"
#include "tests/support/held_out_views.h"
#include "tests/support/occupied_share.h"

namespace cnerf::test {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::size_t free_bytes() {
  std::size_t free = 0, total = 0;
  CNERF_CUDA(cudaMemGetInfo(&free, &total));
  return free;
}

/// Mean dB of the held-out views.
double held_out_psnr(const PackedCapture& packed, const LuminanceEngine& engine, const MarchSettings& march,
                     double min_transmittance) {
  double total = 0;
  const std::vector<HeldOutView> views =
      Judge{packed.capture, packed.frame, engine, march, {float(min_transmittance)}}.judge();
  for (const HeldOutView& view : views) total += view.as_given;
  return views.empty() ? 0 : total / double(views.size());
}

/// @param near  unit space; what is nearer to a camera is empty as well
void exclude(const PackedCapture& packed, LuminanceEngine& engine, const OccupancyOptions& options, double near) {
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

int lenses_among(const std::vector<TrainingView>& views) {
  int most = 0;
  for (const TrainingView& view : views) most = std::max(most, view.lens);
  return most + 1;
}

void set_learning(LuminanceEngineOptions& options, const Arguments& arguments, const std::vector<TrainingView>& views) {
  const bool exposures = arguments.number("exposures", 0) > 0, poses = arguments.number("poses", 0) > 0;
  const bool lenses = arguments.number("lenses", 0) > 0;
  if (!exposures && !poses && !lenses) return;
  options.learning = {int(views.size()), lenses ? lenses_among(views) : 0, exposures, poses};
  ViewLearning& learning = options.learning;
  learning.gain_rate = float(arguments.number("gain_rate", learning.gain_rate));
  learning.lens_rate = float(arguments.number("lens_rate", learning.lens_rate));
  learning.pose_rate = float(arguments.number("pose_rate", learning.pose_rate));
  learning.pose_warm_up = int(arguments.number("pose_warm_up", learning.pose_warm_up));
  learning.finest_pose_cells = int(arguments.number("pose_cells", learning.finest_pose_cells));
  learning.pose_blocks = int(arguments.number("pose_blocks", learning.pose_blocks));
}

}  // namespace

int train(const Arguments& arguments) {
  PackedCapture packed = read_packed(arguments.text("capture", "."));
  const std::vector<Affined>& truth = packed.truth;
  disturb(packed.capture, {arguments.number("gain", 0), arguments.number("degrees", 0), arguments.number("shift", 0),
                           arguments.number("focal", 0)});
  std::vector<TrainingView> views = training_views(packed.capture, packed.frame);
  const std::vector<DepthHints> depths = depth_hints(packed.capture, packed.frame, packed.capture.points);
  show_to(views, depths);
  const double seconds = arguments.number("seconds", 10), rate = arguments.number("rate", 1e-2);
  const double final_rate = arguments.number("final_rate", 5e-4), hold = arguments.number("hold", 0.5);
  std::vector<double> report_at;
  for (const double t : {1.0, 2.0, 5.0, 10.0, 30.0}) {
    if (t <= seconds) report_at.push_back(t);
  }
  if (arguments.number("marks", 1) == 0) report_at = {seconds};
  for (int seed = 1; seed <= int(arguments.number("seeds", 1)); ++seed) {
    LuminanceEngineOptions options = engine_options(arguments, packed.frame.cascades);
    options.seed = std::uint64_t(seed);
    set_learning(options, arguments, views);
    const std::size_t free_before = free_bytes();
    const auto made = make_cuda_luminance_engine(options);
    LuminanceEngine& engine = *made;
    engine.set_views(views);
    exclude(packed, engine, options.occupancy, arguments.number("near", 0));
    double elapsed = 0;
    std::size_t next = 0;
    StepReport report;
    double trained = 0, rays = 0;
    std::printf("seed %d:", seed);
    while (next < report_at.size()) {
      const Clock::time_point start = Clock::now();
      while (elapsed + seconds_since(start) < report_at[next]) {
        const double fraction = (elapsed + seconds_since(start)) / seconds;
        const double decay = std::clamp((fraction - hold) / (1 - hold), 0.0, 1.0);
        report = engine.step(float(rate * std::pow(final_rate / rate, decay)));
        trained += double(report.trained_samples);
        rays += double(report.rays);
      }
      wait_for(engine);
      elapsed += seconds_since(start);
      std::printf("  %.0f s %ld steps %.2f dB", report_at[next], engine.step_count(),
                  held_out_psnr(packed, engine, options.march, arguments.number("min_transmittance", 1e-3)));
      std::fflush(stdout);
      ++next;
    }
    std::printf("  | %.0f steps/s, %.0f rays a step, %.1f samples per ray, %.0f MiB, occupied %.4f\n",
                double(engine.step_count()) / elapsed, rays / double(engine.step_count()), trained / rays,
                double(free_before - free_bytes()) / (1 << 20),
                occupied_share(engine.occupancy(), {options.occupancy.resolution, options.cascades}));
    if (arguments.number("views", 0) > 0) {
      const std::string pictures = seed == 1 ? arguments.text("pictures", "") : "";
      Judge judge{
          packed.capture, packed.frame, engine, options.march, {float(arguments.number("min_transmittance", 1e-3))},
          pictures};
      if (arguments.number("aligned", 0) > 0) judge.alignment = print_alignment(judge, truth);
      print_held_out(judge.judge());
    }
  }
  return 0;
}

int bench(const Arguments& arguments) {
  const PackedCapture packed = read_packed(arguments.text("capture", "."));
  const std::vector<TrainingView> views = training_views(packed.capture, packed.frame);
  LuminanceEngineOptions options = engine_options(arguments, packed.frame.cascades);
  set_learning(options, arguments, views);
  const std::size_t free_before = free_bytes();
  const Clock::time_point begin = Clock::now();
  const auto made = make_cuda_luminance_engine(options);
  LuminanceEngine& engine = *made;
  exclude(packed, engine, options.occupancy, arguments.number("near", 0));
  engine.set_views(views);
  std::printf("set up in %.2f s\n", seconds_since(begin));
  const int steps = int(arguments.number("steps", 1000));
  for (int i = 0; i < steps; ++i) engine.step(float(1e-2 * std::pow(0.05, std::max(0.0, 2.0 * i / steps - 1))));
  wait_for(engine);
  const Clock::time_point start = Clock::now();
  constexpr int kTimed = 320;
  StepReport report;
  for (int i = 0; i < kTimed; ++i) report = engine.step(5e-4f);
  wait_for(engine);
  const double per_step = 1e3 * seconds_since(start) / kTimed;
  std::printf("after %d steps: %zu rays, %zu trained samples, loss %.5f, occupied %.4f, %.0f MiB\n", steps, report.rays,
              report.trained_samples, report.loss,
              occupied_share(engine.occupancy(), {options.occupancy.resolution, options.cascades}),
              double(free_before - free_bytes()) / (1 << 20));
  std::printf("step %.3f ms = %.0f steps/s\n", per_step, 1e3 / per_step);
  for (const double min_transmittance : {1e-4, 1e-3, 1e-2, 3e-2}) {
    std::printf("rendered to transmittance %.0e: %.3f dB\n", min_transmittance,
                held_out_psnr(packed, engine, options.march, min_transmittance));
  }
  const View& view = packed.capture.views.front();
  const int magnified = int(arguments.number("magnified", 1));
  const Intrinsics lens = resized(view.intrinsics, magnified * view.image.width, magnified * view.image.height);
  const UnitCamera camera(lens, view.world_from_camera, packed.frame);
  std::vector<RayResult> results(std::size_t(lens.width) * std::size_t(lens.height));
  for (const double min_transmittance : {1e-4, 1e-3, 1e-2, 3e-2}) {
    double times[2] = {1e9, 1e9};
    for (int i = 0; i < 10; ++i) {
      Clock::time_point before = Clock::now();
      engine.render_view(camera, options.march, {float(min_transmittance)}, {});
      times[0] = std::min(times[0], 1e3 * seconds_since(before));
      before = Clock::now();
      engine.render_view(camera, options.march, {float(min_transmittance)}, results);
      times[1] = std::min(times[1], 1e3 * seconds_since(before));
    }
    std::printf("render %dx%d to transmittance %.0e: %.2f ms on the GPU, %.2f ms with the download\n", lens.width,
                lens.height, min_transmittance, times[0], times[1]);
  }
  return 0;
}

}  // namespace cnerf::test
