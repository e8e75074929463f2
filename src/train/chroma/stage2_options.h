#pragma once
/// What stage 2 can be told.

#include "encoding/hash_grid_levels.h"
#include "src/base/options.h"
#include "src/colorizer/purify_options.h"

namespace cnerf {

struct Stage2Options {
  int patches = 600;
  int patch_size = 128;
  int rays_per_patch = 4096;
  double learning_rate = 3e-2, final_learning_rate = 1e-3;
  int working_resolution = 384;
  double spread_weight = 0.1, regression_weight = 1;
  double sure_colors = 40;
  double decode_temperature = 0.6;
  int distill_steps = 1000;
  int colorizer_batch = 16;
  int seed = 1;
  HashGridOptions grid = {.decay = 0.1};
  PurifyOptions purify;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("patches", patches, Range{1, 1e7}, "updates: one per accepted patch; with known colours one per patch");
    v("patch_size", patch_size, Range{16, 512}, "K: pixels along a side of a patch");
    v("rays_per_patch", rays_per_patch, Range{64, 1 << 20},
      "pixels of a patch that are trained on, and as many of key frames and hints");
    v("learning_rate", learning_rate, Range{1e-8, 1}, "Adam's step size at the start");
    v("final_learning_rate", final_learning_rate, Range{1e-8, 1}, "Adam's step size at the end");
    v("working_resolution", working_resolution, Range{32, 4096}, "short side at which samples are cached, pixels");
    v("spread_weight", spread_weight, Range{0, 1000},
      "of a loss on how far apart the features of a ray's samples lie: for colours that agree from view to view");
    v("regression_weight", regression_weight, Range{0, 1000},
      "of a loss on how far the mean of a pixel's distribution is from the answer's colour");
    v("sure_colors", sure_colors, Range{0, 313},
      "n0: an answer torn between n > n0 equally likely colours weighs (n0 / n)^2; 0 = all weigh the same");
    v("decode_temperature", decode_temperature, Range{0, 10}, "annealed-mean temperature; 0 = arg-max");
    v("distill_steps", distill_steps, Range{0, 1e6}, "steps of the fit of per-sample colour that baking uses");
    v("colorizer_batch", colorizer_batch, Range{1, 64}, "patches per query of the colorizer");
    v("seed", seed, Range{0, 1e9}, "of patches and weights");
    v.section("grid", grid);
    v.section("purify", purify);
  }
};

}  // namespace cnerf
