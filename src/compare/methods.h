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
  bool is_purified = true;        ///< as configured; else every answer is trained on
  bool is_photometric = false;    ///< the Photometric injection of stage2_variants.h
  bool asks_about_views = false;  ///< its colorizer sees each view whole and once: ViewQuestions of stage2_variants.h
  bool follows_flow = false;      ///< carries colours from view to view
  bool matches_features = false;  ///< style transfer: asks no colorizer about patches
  bool has_own_field = false;     ///< the paper's MLP instead of the hash grid
  bool knows_truth = false;       ///< asks a colorizer that answers the true colours
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
     .asks_about_views = true},
    {.name = "video-then-fuse",
     .summary = "as colorize-then-fuse, with colours carried from view to view by optical flow; stands in for a video "
                "colorization network (the paper's Vid+NeRF)",
     .is_purified = false,
     .is_photometric = true,
     .asks_about_views = true,
     .follows_flow = true},
    {.name = "style-transfer",
     .summary =
         "ARF: colours are changed until the features of pictures are those of a reference image (nearest-neighbour "
         "feature matching), which is a training view coloured by the colorizer unless another is given",
     .matches_features = true},
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
