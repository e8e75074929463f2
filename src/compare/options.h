#pragma once
/// Options of a comparison: those of a run, and a section of its own.

#include <string>

#include "src/base/options.h"
#include "src/config/config.h"

namespace cnerf::compare {

/// What single methods need.
struct CompareOptions {
  double positional_budget = 4;
  std::string style_reference, style_network;
  int style_steps = 160;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("positional_budget", positional_budget, Range{0.01, 1000},
      "training time of stage 1 of the paper's field, in times of the hash grid's");
    v("style_reference", style_reference,
      "image whose style is transferred; empty: the middle training view, coloured by the colorizer");
    v("style_network", style_network,
      "TorchScript module whose features are matched; empty: the AlexNet of --lpips-weights");
    v("style_steps", style_steps, Range{4, 1e6}, "pictures that style transfer renders and follows");
  }
};

/// Everything that a comparison can be told.
struct CompareConfig {
  Config run;
  CompareOptions own;

  template <typename Visitor>
  void visit(Visitor&& v) {
    run.visit(v);
    v.section("compare", own);
  }
};

}  // namespace cnerf::compare
