#pragma once
/// Options of web bundles.

#include <string>

#include "src/base/options.h"

namespace cnerf {

struct WebOptions {
  int resolution = 256;        ///< voxels along the longest axis, at most
  std::string density = "r8";  ///< r8: 8 bits on a cubic scale; r16f: 16-bit floats
  int photo_side = 640;        ///< pixels of a photograph's long side; 0 = no photographs
  int photo_quality = 82;      ///< of JPEG

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("resolution", resolution, Range{16, 1024}, "voxels along the longest axis, at most those of the bake");
    v("density", density, Choice{"r8", "r16f"}, "8 bits on a cubic scale, or 16-bit floats");
    v("photo_side", photo_side, Range{0, 8192}, "pixels of a photograph's long side; 0 leaves them out");
    v("photo_quality", photo_quality, Range{1, 100}, "of JPEG");
  }
};

}  // namespace cnerf
