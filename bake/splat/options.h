#pragma once
/// Options of splats.

#include "src/base/options.h"

namespace cnerf::bake {

struct SplatOptions {
  int count = 500000;
  int steps = 1500;
  int picture_side = 480;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("count", count, Range{100, 1e7}, "splats, at most");
    v("steps", steps, Range{0, 1e6}, "pictures that splats are fitted to, one after another; 0 leaves them as placed");
    v("picture_side", picture_side, Range{16, 4096}, "pixels of the long side of these pictures, at most");
  }
};

}  // namespace cnerf::bake
