// cnerf-cuda-check: benchmarks of the CUDA engine for a machine that has a GPU and a driver, and nothing else. Whether
// the engine is right is for cnerf-backend-ops to say.
//
//   cnerf-cuda-check bench  capture=FOLDER [steps=1000] [option=value ...]
//   cnerf-cuda-check bench-stage2 capture=FOLDER [steps=3000] [rays=4096] [option=value ...]
//   cnerf-cuda-check train  capture=FOLDER [seconds=10] [seeds=1] [option=value ...]
//
// FOLDER is what pack_capture made. Options: levels, log2_rows, coarsest, finest, samples, steps_per_box, cone_angle,
// rate, final_rate.

#include <cstdio>
#include <exception>

#include "tests/cuda/check.h"

namespace cnerf::test {

LuminanceEngineOptions engine_options(const Arguments& arguments, int cascades) {
  LuminanceEngineOptions options;
  options.grid.levels = int(arguments.number("levels", 8));
  options.grid.log2_rows = int(arguments.number("log2_rows", 19));
  options.grid.coarsest_resolution = int(arguments.number("coarsest", 16));
  options.grid.finest_resolution = int(arguments.number("finest", 2048));
  options.grid.decay = arguments.number("table_decay", 0);
  options.cascades = cascades;
  options.march =
      march_settings(cascades, int(arguments.number("steps_per_box", 256)), 1.0 / arguments.number("cone", 64));
  options.samples_per_step = int(arguments.number("samples", 1 << 18));
  options.occupancy.decay = float(arguments.number("decay", options.occupancy.decay));
  options.occupancy.optical_thickness = float(arguments.number("thickness", options.occupancy.optical_thickness));
  options.distortion_weight = float(arguments.number("distortion", options.distortion_weight));
  options.depth.weight = float(arguments.number("depth", 0));
  options.depth.half_life = float(arguments.number("depth_half", options.depth.half_life));
  options.seed = std::uint64_t(arguments.number("seed", 1));
  return options;
}

void wait_for(const LuminanceEngine& engine) {
  const Vec3f point = {0.5f, 0.5f, 0.5f};
  float sigma = 0;
  engine.query_density({&point, 1}, {&sigma, 1});  // stands behind the steps in their queue
}

}  // namespace cnerf::test

int main(int argc, char** argv) {
  const std::string command = argc > 1 ? argv[1] : "";
  const cnerf::test::Arguments arguments(argc, argv, 2);
  try {
    if (command == "bench") return cnerf::test::bench(arguments);
    if (command == "bench-stage2") return cnerf::test::bench_stage2(arguments);
    if (command == "train") return cnerf::test::train(arguments);
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "%s\n", failure.what());
    return 1;
  }
  std::puts("cnerf-cuda-check bench capture=FOLDER | bench-stage2 capture=FOLDER | train capture=FOLDER");
  return 64;
}
