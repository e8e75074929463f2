// A baked volume in the real Blender: renders views of a capture in Cycles (linear EXR, box filter, volume step rate
// 0.25) and compares them with our own integrator on the same grids, with the capture's colours where anything is, and,
// where snapshots are given, with the field's own render (averaged=1: with the view-averaged field), see Likeness.
//
//   cycles_comparison BAKE CAPTURE [STAGE1.snapshot [TAKE.snapshot]] [views=3] [samples=64] [downscale=1] [holdout=0]
//                     [trained=0] [averaged=0] [pictures=0] [ours=1]
//   cycles_comparison BAKE CAPTURE RENDERS [...]
//
// RENDERS is a folder with the field's pictures instead, as `cnerf render RUN --view-averaged --path held-out --format
// exr` leaves them: made on a GPU, say.
//
// BAKE is the folder with the VDB files, manifest.json and blender_setup.py. The views are the first held-out ones (all
// views where none is), with trained=1 some of the others, evenly spread. With pictures=1 the folder gets
// `cycles_comparison.png`: Cycles, field, and their difference. With ours=0 our own integrator, which takes longer than
// Cycles where grids are nested, is left out.

#include <cstdio>
#include <optional>
#include <string>

#include "bake/volume/integrate.h"
#include "export/vdb_reader.h"
#include "src/capture/color_truth.h"
#include "src/capture/load_capture.h"
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
  auto [files, options] = cnerf::bench::parse_arguments(argc, argv,
                                                        {{"views", 3},
                                                         {"samples", 64},
                                                         {"downscale", 1},
                                                         {"holdout", 0},
                                                         {"trained", 0},
                                                         {"averaged", 0},
                                                         {"pictures", 0},
                                                         {"ours", 1}});
  if (files.size() < 2) {
    std::puts(
        "cycles_comparison BAKE CAPTURE [STAGE1.snapshot [TAKE.snapshot] | RENDERS] [views=N] [samples=N] "
        "[downscale=N] "
        "[holdout=N] [trained=0|1] [averaged=0|1] [pictures=0|1] [ours=0|1]");
    return 64;
  }
  const std::filesystem::path bake = files[0];
  cnerf::CaptureOptions capture_options;
  capture_options.downscale = options["downscale"];
  capture_options.holdout = options["holdout"];
  const cnerf::Capture capture = cnerf::load_capture(files[1], capture_options);
  const std::vector<cnerf::bake::Volume> volumes = cnerf::exporting::read_volumes(bake);
  const bool has_renders = files.size() > 2 && std::filesystem::is_directory(files[2]);
  const auto scene = files.size() > 2 && !has_renders
                         ? cnerf::Scene::load(files[2], files.size() > 3 ? files[3] : "", cnerf::cpu_engines())
                         : nullptr;
  const auto average =
      scene && options["averaged"] != 0
          ? cnerf::bench::average_behind(cnerf::exporting::read_manifest(bake / "manifest.json"), *scene, capture)
          : nullptr;
  const auto views = cnerf::bench::views_to_compare(capture, options["trained"] != 0, options["views"]);

  cnerf::ContactSheet sheet({"Cycles", "field", "difference x 2"}, 1000);
  for (const cnerf::View* view : views) {
    const RenderedExr cycles = cnerf::test::render_exact(
        bake / "blender_setup.py",
        "--camera '" + view->name + "' --samples " + std::to_string(options["samples"]) + " --step-rate 0.25");
    if (options["ours"] != 0) {
      const auto ours = cnerf::bake::integrate_volumes(volumes, view->intrinsics, view->world_from_camera);
      const auto truth = cnerf::load_color_truth(*view);
      const Differences sums = differences(cycles, ours, truth);
      std::printf("%s: Cycles against our integrator %.2f dB (linear)", view->name.c_str(),
                  decibels(sums.ours, sums.values));
      if (truth) std::printf(", against the true colours %.2f dB (sRGB)", decibels(sums.truth, sums.values));
      std::printf(", over %zu pixels\n", sums.values / 3);
    }
    if (scene || has_renders) {
      const auto field = has_renders ? cnerf::bench::read_render(files[2], *view)
                                     : scene->render(view->intrinsics, view->world_from_camera,
                                                     cnerf::bench::field_options(*scene, average.get()));
      const char* what = has_renders ? files[2].c_str() : average ? "the view-averaged field" : "the field";
      std::printf("%s: Cycles against %s %s\n", view->name.c_str(), what,
                  cnerf::bench::likeness_of(cycles.rgba, field).text().c_str());
      if (options["pictures"] != 0) cnerf::bench::add_row(sheet, cycles.rgba, field);
    }
    std::fflush(stdout);
  }
  if (options["pictures"] != 0) write_png(bake / "cycles_comparison.png", sheet.compose());
  return views.empty() ? 65 : 0;
}
