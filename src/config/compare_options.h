#pragma once
/// Options of single methods of a comparison.

#include <string>

#include "src/base/options.h"

namespace cnerf {

/// What single methods need beyond the configuration of a run.
struct CompareOptions {
  double positional_budget = 4;                  ///< stage 1 of the paper's field, in times of the hash grid's
  double positional_learning_rate = 5e-4;        ///< of the paper's field (Mildenhall et al. 2020), in both stages
  double positional_final_learning_rate = 5e-5;  ///< at their ends
  std::string positional_geometry = "shared";    ///< whose geometry its stage 2 stands on
  bool positional_trains_encoding = false;       ///< stage 2 changes its copy of the point encoding

  std::string style_reference;  ///< image whose style is transferred; empty = a training view, coloured
  std::string style_network;    ///< TorchScript module of features; empty = LPIPS's AlexNet
  int style_steps = 160;        ///< pictures that style transfer renders

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("positional_budget", positional_budget, Range{0.01, 1000},
      "training time of stage 1 of the paper's field, in times of the hash grid's");
    v("positional_learning_rate", positional_learning_rate, Range{1e-8, 1}, "its step size at the start, both stages");
    v("positional_final_learning_rate", positional_final_learning_rate, Range{1e-8, 1}, "its step size at the end");
    v("positional_geometry", positional_geometry, Choice{"shared", "own"},
      "its stage 2 stands on the stage 1 that all rows share, or on its own");
    v("positional_trains_encoding", positional_trains_encoding,
      "its stage 2 changes the point encoding instead of keeping it fixed as in the paper");
    v("style_reference", style_reference,
      "image whose style is transferred; empty: the middle training view, coloured by the colorizer");
    v("style_network", style_network,
      "TorchScript module whose features are matched; empty: the AlexNet of --lpips-weights");
    v("style_steps", style_steps, Range{4, 1e6}, "pictures that style transfer renders and follows");
  }
};

}  // namespace cnerf
