// What a bake keeps of its field: views of a capture rendered from the baked voxels by our own integrator, against
//   * the field's render of the view (averaged=1: the view-averaged field): PSNR of sRGB-encoded colour, see Likeness;
//   * the photograph: PSNR of sRGB-encoded luminance, beside that of the field.
// All over black.
//
//   bake_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [rays=2] [percent_of_step=50] [...]
//
// `rays` are those along each axis of a pixel; for the rest see compare_views.

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "bake/volume/integrate.h"
#include "export/vdb_reader.h"
#include "src/base/error.h"
#include "src/color/colorspace_math.h"
#include "tests/bench/comparison_support.h"

namespace {

using cnerf::bench::decibels;
using cnerf::bench::encoded;

/// Of one view or several.
struct Sums {
  cnerf::bench::Likeness color;
  double bake_photo = 0, field_photo = 0;
  std::size_t pixels = 0;

  void add(const Sums& other) {
    color.add(other.color);
    bake_photo += other.bake_photo;
    field_photo += other.field_photo;
    pixels += other.pixels;
  }
};

std::vector<float> rgba_of(const cnerf::bake::VolumeImage& image) {
  std::vector<float> rgba;
  for (std::size_t p = 0; p < image.opacity.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) rgba.push_back(image.rgb[3 * p + c]);
    rgba.push_back(image.opacity[p]);
  }
  return rgba;
}

Sums compare(const std::vector<float>& rgba, const cnerf::RenderedImage& field, const cnerf::View& view) {
  Sums sums{cnerf::bench::likeness_of(rgba, field), 0, 0, field.luminance.size()};
  for (std::size_t p = 0; p < sums.pixels; ++p) {
    const double photo = encoded(view.image.luminance(p));
    const float luminance = cnerf::luminance_of(cnerf::Vec3f{rgba[4 * p], rgba[4 * p + 1], rgba[4 * p + 2]});
    sums.bake_photo += std::pow(encoded(luminance) - photo, 2);
    sums.field_photo += std::pow(encoded(field.luminance[p]) - photo, 2);
  }
  return sums;
}

void print(const std::string& name, const Sums& sums) {
  std::printf("%s: bake against field %s; luminance against the photograph: bake %.2f dB, field %.2f dB\n",
              name.c_str(), sums.color.text().c_str(), decibels(sums.bake_photo, sums.pixels),
              decibels(sums.field_photo, sums.pixels));
}

}  // namespace

int main(int argc, char** argv) {
  Sums all;
  std::vector<cnerf::bake::Volume> levels;
  const auto each = [&](cnerf::bench::Comparison& comparison, const cnerf::View& view,
                        const cnerf::RenderedImage* field) {
    if (levels.empty()) levels = cnerf::exporting::read_volumes(comparison.bake);
    std::vector<float> rgba = rgba_of(
        cnerf::bake::integrate_volumes(levels, view.intrinsics, view.world_from_camera,
                                       {comparison.options["percent_of_step"] / 100.0, comparison.options["rays"]}));
    if (field == nullptr) throw cnerf::UsageError("bake_comparison: expected snapshots of the field");
    const Sums sums = compare(rgba, *field, view);
    print(view.name, sums);
    all.add(sums);
    return rgba;
  };
  const int status = cnerf::bench::compare_views(argc, argv, "bake", {{"rays", 2}, {"percent_of_step", 50}}, each);
  if (status == 0) print("all views", all);
  return status;
}
