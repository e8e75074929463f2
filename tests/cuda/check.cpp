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
