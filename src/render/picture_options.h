#pragma once
/// Options of rendered pictures and videos.

#include "src/base/options.h"

namespace cnerf {

struct PictureOptions {
  int frames = 72;
  int fps = 24;
  int short_side = 270;
  int steps_per_box = 512;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("frames", frames, Range{1, 100000}, "pictures of a spiral or an orbit");
    v("fps", fps, Range{1, 240}, "pictures per second of a video");
    v("short_side", short_side, Range{16, 8192}, "pixels of a spiral or an orbit, at most the capture's");
    v("steps_per_box", steps_per_box, Range{16, 8192}, "march steps across the side of the innermost cascade");
  }
};

}  // namespace cnerf
