// A baked mesh in the real Blender: renders held-out views of a capture (all views where none is held out; with
// trained=1 those that are not, evenly spread) and compares
//   * the mesh with the field's own render of the view (averaged=1: with the view-averaged field): silhouettes, and
//   PSNR
//     of sRGB-encoded colour, see Likeness;
//   * the mesh with the volume of the same bake, where there is one: silhouettes.
// All lie over black.
//
//   mesh_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=3] [samples=16] [volume=1] [trained=0]
//                   [averaged=0] [downscale=1] [holdout=0] [pictures=0]
//
// BAKE is the folder with manifest.json and blender_setup.py. With pictures=1 it gets `mesh_comparison.png`: mesh,
// field, and their difference, which is grey where there is none.

#include <cstdio>
#include <string>

#include "src/capture/load_capture.h"
#include "tests/bench/comparison_support.h"
#include "tests/blender/blender_run.h"

using cnerf::test::RenderedExr;

int main(int argc, char** argv) {
  auto [files, options] = cnerf::bench::parse_arguments(argc, argv,
                                                        {{"views", 3},
                                                         {"samples", 16},
                                                         {"volume", 1},
                                                         {"trained", 0},
                                                         {"averaged", 0},
                                                         {"downscale", 1},
                                                         {"holdout", 0},
                                                         {"pictures", 0}});
  if (files.size() < 3) {
    std::puts(
        "mesh_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=N] [samples=N] [volume=0|1] [trained=0|1] "
        "[averaged=0|1] [downscale=N] [holdout=N] [pictures=0|1]");
    return 64;
  }
  const std::filesystem::path bake = files[0];
  cnerf::CaptureOptions capture_options;
  capture_options.downscale = options["downscale"];
  capture_options.holdout = options["holdout"];
  const cnerf::Capture capture = cnerf::load_capture(files[1], capture_options);
  const cnerf::exporting::BakeManifest manifest = cnerf::exporting::read_manifest(bake / "manifest.json");
  const auto scene = cnerf::Scene::load(files[2], files.size() > 3 ? files[3] : "", cnerf::cpu_engines());
  const auto average = options["averaged"] != 0 ? cnerf::bench::average_behind(manifest, *scene, capture) : nullptr;
  const cnerf::RenderOptions render = cnerf::bench::field_options(*scene, average.get());
  const auto views = cnerf::bench::views_to_compare(capture, options["trained"] != 0, options["views"]);

  cnerf::ContactSheet sheet({"mesh", "field", "difference x 2"}, 1000);
  for (const cnerf::View* view : views) {
    const std::string look = "--camera '" + view->name + "' --samples " + std::to_string(options["samples"]);
    const RenderedExr mesh = cnerf::test::render_exact(bake / "blender_setup.py", look + " --mesh only");
    const cnerf::RenderedImage field = scene->render(view->intrinsics, view->world_from_camera, render);
    std::printf("%s: mesh against field %s\n", view->name.c_str(),
                cnerf::bench::likeness_of(mesh.rgba, field).text().c_str());
    if (options["volume"] != 0 && manifest.volume) {
      const RenderedExr volume = cnerf::test::render_exact(bake / "blender_setup.py", look);
      cnerf::bench::Likeness likeness;
      for (std::size_t p = 0; p < mesh.rgba.size(); p += 4) {
        likeness.add(&mesh.rgba[p], &volume.rgba[p], volume.rgba[p + 3]);
      }
      std::printf("%s: mesh against volume, silhouettes IoU %.4f\n", view->name.c_str(), likeness.overlap());
    }
    std::fflush(stdout);
    if (options["pictures"] != 0) cnerf::bench::add_row(sheet, mesh.rgba, field);
  }
  if (options["pictures"] != 0) write_png(bake / "mesh_comparison.png", sheet.compose());
  return views.empty() ? 65 : 0;
}
