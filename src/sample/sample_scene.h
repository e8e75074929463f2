#pragma once
/// The embedded sample: a procedural scene, ray-traced by our own code, with exact colour and depth.

#include <filesystem>
#include <string>

#include "src/base/options.h"
#include "src/base/progress.h"

namespace cnerf {

struct SampleSceneOptions {
  int views = 40;
  std::string path = "around";
  int width = 320, height = 240;
  int samples_per_pixel = 16;
  bool cloth = false, moving_shadow = false, exposures = false, sky = false;
  int seed = 1;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("views", views, Range{2, 1000}, "camera positions");
    v("path", path, Choice{"around", "orbit"},
      "views spread all around by the golden angle, or one after another along a circle");
    v("width", width, Range{16, 4096}, "pixels");
    v("height", height, Range{16, 4096}, "pixels");
    v("samples_per_pixel", samples_per_pixel, Range{1, 1024}, "square number of stratified samples");
    v("cloth", cloth, "a cloth under the plate as far as one sees: nothing is cut out");
    v("moving_shadow", moving_shadow, "on a cloth, with the photographer's shadow, which moves from view to view");
    v("exposures", exposures, "each view exposed anew, by up to 30 % more or less light, as telephones do");
    v("sky", sky, "outdoors: cameras stand low, the cloth lies in haze far away, and half of the pixels are sky");
  }
};

/// Writes a capture a user could have made: `images/*.png` (grey), `transforms.json` (with bounds and a train/test
/// split of every 8th view); beside it `color/*.png` (ground truth, same names), `depth/*.exr` (distance along the
/// optical axis, world units, 0 = nothing hit) and `references/*.png`, three colour views from around the scene that
/// serve as `reference:`. Shadow and exposures are in the grey pictures and in the ground truth. With a sky there are
/// no bounds, and beside the rest lie `sky/*.png`: white where a pixel shows nothing but the sky. Same options, same
/// bytes, on any number of threads.
/// @throws Interrupted  when the user asked to stop; views that were written stay
void write_sample_scene(const std::filesystem::path& folder, const SampleSceneOptions& options,
                        const ProgressSink& progress = {});

}  // namespace cnerf
