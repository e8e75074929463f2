#pragma once
/// The methods a comparison runs: the paper's, its ablations and its baselines, as differences from one configuration.
/// All share stage 1, the colorizer and the number of steps.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "src/capture/capture.h"
#include "src/colorizer/colorizer.h"
#include "src/train/chroma/stage2.h"

namespace cnerf::compare {

struct Method {
  const char* name;     ///< "without-purification": of rows and folders
  const char* summary;  ///< a sentence for the report
  bool is_colored = true;
  bool is_purified = true;      ///< as configured; else every answer is trained on
  bool is_photometric = false;  ///< the Photometric injection of stage2_variants.h
  /// Its colorizer sees each view whole, once at each of so many sizes, each half of the one before: ViewQuestions of
  /// stage2_variants.h; 0 = it is asked about patches.
  int view_sizes = 0;
  bool follows_flow = false;       ///< carries colours from view to view
  bool distills_key_view = false;  ///< its colorizer is fitted to one view that the colorizer coloured
  bool matches_features = false;   ///< style transfer: asks no colorizer about patches
  bool follows_text = false;       ///< asks no colorizer at all
  bool has_own_field = false;      ///< the paper's MLP instead of the hash grid
  bool knows_truth = false;        ///< asks a colorizer that answers the true colours
};

/// Own method first; the order of rows.
inline constexpr Method kMethods[] = {
    {"colornerf", "the full method, as configured"},
    {"colornerf-paper",
     "with the paper's choices: the most probable colour instead of the annealed mean, bases as they come, no loss on "
     "spread"},
    {.name = "without-purification", .summary = "every answer of the colorizer is trained on", .is_purified = false},
    {.name = "without-classification",
     .summary = "a photometric ab loss instead of the distribution over colours",
     .is_photometric = true},
    {.name = "colorize-then-fuse",
     .summary = "each training view is colorized once and whole, and fused with a photometric loss, as the paper's "
                "CT2+NeRF",
     .is_purified = false,
     .is_photometric = true,
     .view_sizes = 1},
    {.name = "video-then-fuse",
     .summary = "as colorize-then-fuse, with colours carried from view to view by optical flow; stands in for a video "
                "colorization network (the paper's Vid+NeRF)",
     .is_purified = false,
     .is_photometric = true,
     .view_sizes = 1,
     .follows_flow = true},
    {.name = "multi-scale-teacher",
     .summary =
         "as colorize-then-fuse, with each view colorized at its size, half and a quarter of it, after ChromaDistill",
     .is_purified = false,
     .is_photometric = true,
     .view_sizes = 3},
    {.name = "key-view-distilled",
     .summary =
         "after Color3D: one view is colorized, a colorizer of the scene is fitted to it, and what that makes of the "
         "views is fused as in colorize-then-fuse",
     .is_purified = false,
     .is_photometric = true,
     .view_sizes = 1,
     .distills_key_view = true},
    {.name = "style-transfer",
     .summary =
         "ARF: colours are changed until the features of pictures are those of a reference image (nearest-neighbour "
         "feature matching), which is a training view coloured by the colorizer unless another is given",
     .matches_features = true},
    {.name = "clip-nerf",
     .summary =
         "colours are changed until an image encoder makes of pictures what a text encoder makes of a text, after "
         "CLIP-NeRF",
     .follows_text = true},
    {.name = "positional-encoding",
     .summary = "the paper's own field, an MLP of eight layers of 256 with positional encoding, in place of the hash "
                "grid; as many patches; see the table of training times",
     .has_own_field = true},
    {.name = "grey", .summary = "no colour at all: the lower bound", .is_colored = false},
    {.name = "oracle",
     .summary = "the full method, its colorizer answering the true colours: the upper bound",
     .knows_truth = true},
};

/// Step sizes of the paper's field at the start and at the end of both stages (Mildenhall et al. 2020).
inline constexpr double kPositionalLearningRate = 5e-4, kPositionalFinalLearningRate = 5e-5;

/// Names in the order of rows.
[[nodiscard]] std::vector<std::string> method_names();
/// "colornerf,grey", or "all".  @throws UsageError  naming an unknown one and those there are.
[[nodiscard]] std::vector<const Method*> parse_methods(const std::string& list);

/// The options of a method's stage 2.
[[nodiscard]] Stage2Options stage2_of(const Method& method, Stage2Options configured);

}  // namespace cnerf::compare
