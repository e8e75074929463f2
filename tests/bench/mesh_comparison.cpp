// A baked mesh in the real Blender: renders views of a capture and compares
//   * the mesh with the field's own render of the view (averaged=1: with the view-averaged field): silhouettes, and
//   PSNR
//     of sRGB-encoded colour, see Likeness;
//   * the mesh with the volume of the same bake, where there is one: silhouettes.
// All lie over black.
//
//   mesh_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [samples=16] [volume=1] [...]
//
// BAKE is the folder with manifest.json and blender_setup.py; for the rest see compare_views.

#include <cstdio>
#include <string>

#include "tests/bench/comparison_support.h"
#include "tests/blender/blender_run.h"

using cnerf::test::RenderedExr;

int main(int argc, char** argv) {
  const auto each = [](cnerf::bench::Comparison& comparison, const cnerf::View& view,
                       const cnerf::RenderedImage* field) {
    const std::string script = comparison.bake / "blender_setup.py";
    const std::string look = "--camera '" + view.name + "' --samples " + std::to_string(comparison.options["samples"]);
    const RenderedExr mesh = cnerf::test::render_exact(script, look + " --mesh only");
    if (field != nullptr) {
      std::printf("%s: mesh against field %s\n", view.name.c_str(),
                  cnerf::bench::likeness_of(mesh.rgba, *field).text().c_str());
    }
    if (comparison.options["volume"] != 0 && comparison.manifest.volume) {
      const RenderedExr volume = cnerf::test::render_exact(script, look);
      cnerf::bench::Likeness likeness;
      for (std::size_t p = 0; p < mesh.rgba.size(); p += 4) {
        likeness.add(&mesh.rgba[p], &volume.rgba[p], volume.rgba[p + 3]);
      }
      std::printf("%s: mesh against volume, silhouettes IoU %.4f\n", view.name.c_str(), likeness.overlap());
    }
    return mesh.rgba;
  };
  return cnerf::bench::compare_views(argc, argv, "mesh", {{"samples", 16}, {"volume", 1}}, each);
}
