#pragma once
/// What the purification can be told.

#include <string>

#include "src/base/options.h"

namespace cnerf {

struct PurifyOptions {
  bool enabled = true;
  int base_images = 5;
  int opinions = 16;
  double threshold = 0.80;
  std::string picked_bases;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("enabled", enabled, "reject outlier answers of the colorizer");
    v("base_images", base_images, Range{1, 64}, "patches answers are compared with");
    v("opinions", opinions, Range{1, 256},
      "answers about the place of a base, which is the one most like the most typical of all; 1 = the first one");
    v("threshold", threshold, Range{-1, 1}, "T: histogram similarity an answer must exceed");
    v("picked_bases", picked_bases, "comma-separated candidates to use as bases; empty chooses");
  }
};

}  // namespace cnerf
