#pragma once
/// Stage 2: chroma by querying a 2-D colorizer (paper, Sec. "Color representation prediction").

#include <filesystem>
#include <string>

#include "encoding/hash_grid_levels.h"
#include "src/base/observer.h"
#include "src/base/options.h"
#include "src/capture/capture.h"
#include "src/colorizer/colorizer.h"
#include "src/colorizer/purify.h"
#include "src/engine/engines.h"
#include "src/train/known_colors.h"

namespace cnerf {

struct Stage2Options {
  int patches = 600;                         ///< accepted patches
  std::string questions = "patches";         ///< what the colorizer is shown: patches drawn afresh, or each view once
  std::string injection = "classification";  ///< a distribution over ab bins, or a photometric loss of ab
  int patch_size = 128;                      ///< K
  double scale_min = 0.3, scale_max = 0.7;   ///< s: the patch's side as a share of the image's short side
  int rays_per_patch = 4096;                 ///< pixels of a patch that are trained on
  double known_share = 1;  ///< pixels of known colours trained on with a patch, as a share of rays_per_patch
  double learning_rate = 3e-2;
  double final_learning_rate = 1e-3;
  int working_resolution = 384;     ///< short side, pixels, at which samples are cached
  double cached_weight = 0.99;      ///< share of a pixel's weight the cached samples carry
  double rebalancing = 0;           ///< lambda mixing of class rebalancing; 0 = off
  double spread_weight = 0.1;       ///< of the spread of a pixel's features in the loss (src/engine/chroma_math.h)
  double regression_weight = 1;     ///< of how far the distribution's mean colour is from the answer, in the loss
  double decode_temperature = 0.6;  ///< annealed-mean temperature; 0 = arg-max
  int distill_steps = 1000;         ///< steps of the fit of per-sample colour for baking
  int colorizer_batch = 4;          ///< patches a colorizer query
  int seed = 1;
  HashGridOptions grid = {.decay = 0.1};
  PurifyOptions purify;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("patches", patches, Range{1, 1e7}, "accepted patches to train on");
    v("questions", questions, Choice{"patches", "views"},
      "what the colorizer is shown: patches drawn afresh, or each view whole and once (colorize, then fuse)");
    v("injection", injection, Choice{"classification", "photometric"},
      "a distribution over the ab bins, or the mean squared ab distance");
    v("patch_size", patch_size, Range{16, 512}, "K: pixels along a side of a patch");
    v("scale_min", scale_min, Range{0.02, 1}, "smallest share of the short side a patch covers");
    v("scale_max", scale_max, Range{0.02, 1}, "largest share of the short side a patch covers");
    v("rays_per_patch", rays_per_patch, Range{64, 1 << 20}, "pixels of a patch that are trained on");
    v("known_share", known_share, Range{0, 16}, "pixels of key frames and hints a patch, as a share of rays_per_patch");
    v("learning_rate", learning_rate, Range{1e-8, 1}, "Adam's step size at the start");
    v("final_learning_rate", final_learning_rate, Range{1e-8, 1}, "Adam's step size at the end");
    v("working_resolution", working_resolution, Range{32, 4096}, "short side at which samples are cached, pixels");
    v("cached_weight", cached_weight, Range{0.5, 1}, "share of a pixel's weight that its cached samples carry");
    v("rebalancing", rebalancing, Range{0, 1}, "class rebalancing: 0 = off, else the share of the prior");
    v("spread_weight", spread_weight, Range{0, 1000},
      "of a loss on how far apart the features of a ray's samples lie: for colours that agree from view to view");
    v("regression_weight", regression_weight, Range{0, 1000},
      "of a loss on how far the mean of a pixel's distribution is from the answer's colour");
    v("decode_temperature", decode_temperature, Range{0, 10}, "annealed-mean temperature; 0 = arg-max");
    v("distill_steps", distill_steps, Range{0, 1e6}, "steps of the fit of per-sample colour that baking uses");
    v("colorizer_batch", colorizer_batch, Range{1, 64}, "patches a colorizer query");
    v("seed", seed, Range{0, 1e9}, "of patches and weights");
    v.section("grid", grid);
    v.section("purify", purify);
  }
};

struct Stage2Report {
  int accepted = 0, rejected = 0;  ///< patches
  double seconds = 0;
  double colorizer_seconds = 0;  ///< that queries took, beside the training but for the base patches
  double waited_seconds = 0;     ///< that the training waited for them
  double bake_ab_distance = 0;   ///< mean ab distance of the baked contract's colour to the per-pixel decode
};

/// What stage 2 works on.
struct Stage2Job {
  const Capture& capture;
  std::filesystem::path stage1;  ///< snapshot of the trained scene
  const Stage2Options& options;
  Colorizer& colorizer;
  std::span<const KnownColors> known;  ///< overrule the colorizer; key frames among them are the purification's bases
  std::filesystem::path take;          ///< snapshot that the result goes to; galleries of patches lie beside it
  bool resume = false;                 ///< go on with the take, if there is one
  /// Where several colorizations of one stage 1 keep its traced views, for as long as working_resolution and
  /// cached_weight are the same; empty at first; null = none of it is kept.
  std::vector<CachedView>* shared = nullptr;
};

/// Colorizes a trained scene. The observer is offered pictures of held-out views, where there are any.
/// @throws ColorizerError, Interrupted, SnapshotError, UsageError.
Stage2Report train_stage2(const Stage2Job& job, const Engines& engines, Observer& observer);

/// Only asks for the base candidates, twelve patches spread over the views, and writes their gallery to `job.take`:
/// what the whole scene would be coloured like, in a minute. `stage2.purify.picked_bases` then picks those that are
/// liked.
/// @throws ColorizerError, Interrupted, SnapshotError, UsageError.
void write_base_candidates(const Stage2Job& job, const Engines& engines, Observer& observer);

}  // namespace cnerf
