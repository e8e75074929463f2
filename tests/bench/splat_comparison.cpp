// How like its field the splats of a bake are: views of a capture drawn from the file by the tests' plain rasterizer,
// as viewers draw it, against the field's render of the view: PSNR of sRGB-encoded colour, see Likeness. Cameras are
// without lens distortion. All over black.
//
//   splat_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [spz=0] [...]
//
// spz=1 reads the SPZ in place of the PLY; for the rest see compare_views.

#include <cstdio>
#include <string>
#include <vector>

#include "bake/splat/bake_splats.h"
#include "src/base/error.h"
#include "tests/bench/comparison_support.h"
#include "tests/export/splat_files.h"

int main(int argc, char** argv) {
  using namespace cnerf;
  bench::Likeness all;
  std::vector<bake::test::FileSplat> splats;
  const auto each = [&](bench::Comparison& comparison, const View& view, const RenderedImage* field) {
    if (field == nullptr) throw UsageError("splat_comparison: expected snapshots of the field");
    const auto& listed = comparison.manifest.splats;
    if (!listed) throw UsageError("splat_comparison: the bake has no splats");
    if (splats.empty()) {
      splats = comparison.options["spz"] != 0 ? exporting::test::read_splat_spz(comparison.bake / listed->spz)
                                              : exporting::test::read_splat_ply(comparison.bake / listed->ply);
    }
    const auto drawn = bake::test::reference_picture(splats, view.intrinsics, view.world_from_camera,
                                                     {bake::nearest_splat(comparison.manifest.frame), 0.3});
    std::vector<float> rgba;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      const auto value = float(std::min(1.0, drawn[i]));
      rgba.push_back(i % 4 == 3 ? value : linear_from_srgb(value));
    }
    const bench::Likeness likeness = bench::likeness_of(rgba, *field);
    std::printf("%s: %zu splats, %s\n", view.name.c_str(), splats.size(), likeness.text().c_str());
    all.add(likeness);
    return rgba;
  };
  const int status = bench::compare_views(argc, argv, "splat", {{"spz", 0}, {"pinhole", 1}}, each);
  if (status == 0) std::printf("all views: %s\n", all.text().c_str());
  return status;
}
