// Packs a capture for cnerf-cuda-check: reads it as `cnerf train` does, places the box, excludes what no view sees.
//
//   pack_capture CAPTURE FOLDER [downscale=1] [holdout=8] [validation=N] [few=N] [points=1]
//
// With `validation` every N-th of the views to be trained on is judged instead of the held-out ones: for choosing
// settings. With `few` every N-th view alone is trained on. With `points` space before sparse points is excluded too;
// they are found where the capture has none.

#include <cstdio>
#include <string>

#include "src/capture/load_capture.h"
#include "src/prepare/sparse_points.h"
#include "src/train/luminance/luminance_model.h"
#include "tests/cuda/packed_capture.h"
#include "tests/support/validation_fold.h"

int main(int argc, char** argv) {
  if (argc < 3) {
    std::puts("pack_capture CAPTURE FOLDER [downscale=N] [holdout=N] [validation=N] [few=N] [points=1]");
    return 64;
  }
  cnerf::CaptureOptions options;
  options.holdout = 8;
  int validation = 0, points = 0, few = 0;
  for (int i = 3; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    (name == "downscale"    ? options.downscale
     : name == "validation" ? validation
     : name == "points"     ? points
     : name == "few"        ? few
                            : options.holdout) = std::stoi(argument.substr(equals + 1));
  }
  cnerf::test::PackedCapture packed;
  packed.capture = cnerf::load_capture(argv[1], options);
  if (validation > 0) cnerf::test::hold_out_of_training(packed.capture, validation);
  if (few > 0) cnerf::test::train_on_few(packed.capture, few);
  cnerf::Stage1Options stage1;
  stage1.free_space = points > 0;
  if (points > 0 && packed.capture.points.empty()) {
    cnerf::Observer silent;
    packed.capture.points = cnerf::prepare::find_sparse_points(packed.capture, silent);
  }
  const auto model = cnerf::LuminanceModel::create(packed.capture, stage1, cnerf::cpu_engines());
  packed.frame = model.frame;
  packed.occupancy_resolution = stage1.occupancy.resolution;
  for (const float density : model.engine->occupancy().densities()) {
    packed.excluded.push_back(density == cnerf::kExcludedCell ? 1 : 0);
  }
  write_packed(packed, argv[2]);
  int held_out = 0;
  for (const auto& view : packed.capture.views) held_out += view.held_out ? 1 : 0;
  std::printf("%zu views of %dx%d, %d held out, %d cascades\n", packed.capture.views.size(),
              packed.capture.views[0].image.width, packed.capture.views[0].image.height, held_out,
              packed.frame.cascades);
  return 0;
}
