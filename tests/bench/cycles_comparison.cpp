// A baked volume in the real Blender: renders views of a capture in Cycles (linear EXR, box filter, volume step rate
// 0.25) and compares them with our own integrator on the same grids, with the capture's colours where anything is, and,
// where it is given, with the field's own render (averaged=1: with the view-averaged field), see Likeness.
//
//   cycles_comparison BAKE CAPTURE [STAGE1.snapshot [TAKE.snapshot] | RENDERS] [samples=64] [ours=1] [...]
//
// BAKE is the folder with the VDB files, manifest.json and blender_setup.py. With ours=0 our own integrator, which
// takes longer than Cycles where grids are nested, is left out. For the rest see compare_views.

#include <cstdio>
#include <optional>
#include <string>

#include "bake/volume/integrate.h"
#include "export/vdb_reader.h"
#include "src/capture/color_truth.h"
#include "tests/bench/comparison_support.h"
#include "tests/blender/blender_run.h"

namespace {

using cnerf::bench::decibels;
using cnerf::bench::encoded;
using cnerf::test::RenderedExr;

/// Mean squared differences over pixels where either renderer of the grids shows something.
struct Differences {
  double ours = 0;   ///< linear, to our integrator
  double truth = 0;  ///< sRGB-encoded, to the capture's colours
  std::size_t values = 0;
};

Differences differences(const RenderedExr& cycles, const cnerf::bake::VolumeImage& ours,
                        const std::optional<cnerf::ColorImage>& truth) {
  Differences sums;
  for (std::size_t p = 0; p < ours.opacity.size(); ++p) {
    const float* rgba = &cycles.rgba[4 * p];
    if (std::max(rgba[3], ours.opacity[p]) <= 0.01f) continue;
    for (std::size_t c = 0; c < 3; ++c, ++sums.values) {
      sums.ours += std::pow(double(rgba[c]) - ours.rgb[3 * p + c], 2);
      if (truth) sums.truth += std::pow(encoded(rgba[c]) - encoded(truth->rgb[3 * p + c]), 2);
    }
  }
  return sums;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<cnerf::bake::Volume> volumes;
  const auto each = [&](cnerf::bench::Comparison& comparison, const cnerf::View& view,
                        const cnerf::RenderedImage* field) {
    const RenderedExr cycles = cnerf::test::render_exact(
        comparison.bake / "blender_setup.py", "--camera '" + view.name + "' --samples " +
                                                  std::to_string(comparison.options["samples"]) + " --step-rate 0.25");
    if (comparison.options["ours"] != 0) {
      if (volumes.empty()) volumes = cnerf::exporting::read_volumes(comparison.bake);
      const auto ours = cnerf::bake::integrate_volumes(volumes, view.intrinsics, view.world_from_camera);
      const auto truth = cnerf::load_color_truth(view);
      const Differences sums = differences(cycles, ours, truth);
      std::printf("%s: Cycles against our integrator %.2f dB (linear)", view.name.c_str(),
                  decibels(sums.ours, sums.values));
      if (truth) std::printf(", against the true colours %.2f dB (sRGB)", decibels(sums.truth, sums.values));
      std::printf(", over %zu pixels\n", sums.values / 3);
    }
    if (field != nullptr) {
      const char* what = comparison.scene == nullptr ? comparison.renders.c_str()
                         : comparison.average        ? "the view-averaged field"
                                                     : "the field";
      std::printf("%s: Cycles against %s %s\n", view.name.c_str(), what,
                  cnerf::bench::likeness_of(cycles.rgba, *field).text().c_str());
    }
    return cycles.rgba;
  };
  return cnerf::bench::compare_views(argc, argv, "cycles", {{"samples", 64}, {"ours", 1}}, each);
}
