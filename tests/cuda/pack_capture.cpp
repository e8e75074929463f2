// Packs a capture for cnerf-cuda-check: reads it as `cnerf train` does, places the box, excludes what no view sees.
//
//   pack_capture CAPTURE FOLDER [downscale=1] [holdout=8] [option=value ...]
//
// With `validation=N` every N-th of the views to be trained on is judged instead of the held-out ones: for choosing
// settings. With `few=N` every N-th view alone is trained on. With `points=1` space before sparse points is excluded
// too; they are found where the capture has none. `degrees`, `shift` and `focal` make cameras worse (Disturbance);
// `poses=1` and `lenses=1` adjust them, as a training that learns them begins.

#include <cstdio>
#include <map>
#include <string>

#include "src/capture/load_capture.h"
#include "src/prepare/bundle_adjustment.h"
#include "src/prepare/sparse_points.h"
#include "src/train/luminance/luminance_model.h"
#include "tests/cuda/packed_capture.h"
#include "tests/support/disturbed_capture.h"
#include "tests/support/validation_fold.h"

namespace {

using Arguments = std::map<std::string, double>;

/// The capture as a training finds it.
cnerf::Capture capture_of(const char* folder, Arguments& own) {
  cnerf::CaptureOptions options;
  options.downscale = int(own["downscale"]);
  options.holdout = int(own["holdout"]);
  cnerf::Capture capture = cnerf::load_capture(folder, options);
  if (own["validation"] > 0) cnerf::test::hold_out_of_training(capture, int(own["validation"]));
  if (own["few"] > 0) cnerf::test::train_on_few(capture, int(own["few"]));
  return capture;
}

/// Adjusts its cameras if a training with these options would, and finds points where it has none.
void prepare(cnerf::Capture& capture, const cnerf::Stage1Options& options) {
  cnerf::Observer silent;
  if (cnerf::prepare::adjusts_cameras(capture, options)) {
    auto cameras = cnerf::prepare::adjust_cameras(capture, options, silent);
    capture.points = std::move(cameras.points);
    std::printf("cameras adjusted: %.3f pixels off, %.3f before\n", cameras.error_after, cameras.error_before);
  }
  if (options.free_space && capture.points.empty()) {
    capture.points = cnerf::prepare::find_sparse_points(capture, silent);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::puts("pack_capture CAPTURE FOLDER [downscale=N] [holdout=N] [option=value ...]");
    return 64;
  }
  Arguments own = {{"downscale", 1}, {"holdout", 8}, {"validation", 0}, {"few", 0},   {"points", 0},
                   {"degrees", 0},   {"shift", 0},   {"focal", 0},      {"poses", 0}, {"lenses", 0}};
  for (int i = 3; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    own.at(argument.substr(0, equals)) = std::stod(argument.substr(equals + 1));
  }
  cnerf::test::PackedCapture packed;
  packed.capture = capture_of(argv[1], own);
  packed.truth = cnerf::test::training_poses(packed.capture);
  cnerf::test::disturb(packed.capture, {.degrees = own["degrees"], .shift = own["shift"], .focal = own["focal"]});
  cnerf::Stage1Options stage1;
  stage1.free_space = own["points"] > 0;
  stage1.poses = own["poses"] > 0;
  stage1.lenses = own["lenses"] > 0;
  prepare(packed.capture, stage1);
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
