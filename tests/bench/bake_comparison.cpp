// What a bake keeps of its field: held-out views of a capture (all views where none is held out; with trained=1 those
// that are not, evenly spread), rendered from the baked voxels by our own integrator, against
//   * the field's render of the view (averaged=1: the view-averaged field): PSNR of sRGB-encoded colour, see Likeness;
//   * the photograph: PSNR of sRGB-encoded luminance, beside that of the field.
// All over black.
//
//   bake_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=3] [downscale=1] [holdout=0] [rays=2]
//                   [percent_of_step=50] [trained=0] [averaged=0] [pictures=0]
//
// BAKE is a folder with manifest.json. `rays` are those along each axis of a pixel. With pictures=1 the folder gets
// `bake_comparison.png`: bake, field, and their difference.

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "bake/volume/integrate.h"
#include "export/vdb_reader.h"
#include "src/capture/load_capture.h"
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
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  auto [files, options] = cnerf::bench::parse_arguments(argc, argv,
                                                        {{"views", 3},
                                                         {"downscale", 1},
                                                         {"holdout", 0},
                                                         {"rays", 2},
                                                         {"percent_of_step", 50},
                                                         {"trained", 0},
                                                         {"averaged", 0},
                                                         {"pictures", 0}});
  if (files.size() < 3) {
    std::puts(
        "bake_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=N] [downscale=N] [holdout=N] "
        "[rays=N] [percent_of_step=N] [trained=0|1] [averaged=0|1] [pictures=0|1]");
    return 64;
  }
  const std::filesystem::path bake = files[0];
  cnerf::CaptureOptions capture_options;
  capture_options.downscale = options["downscale"];
  capture_options.holdout = options["holdout"];
  const cnerf::Capture capture = cnerf::load_capture(files[1], capture_options);
  const auto scene = cnerf::Scene::load(files[2], files.size() > 3 ? files[3] : "", cnerf::cpu_engines());
  const std::vector<cnerf::bake::Volume> levels = cnerf::exporting::read_volumes(bake);
  const auto average =
      options["averaged"] != 0
          ? cnerf::bench::average_behind(cnerf::exporting::read_manifest(bake / "manifest.json"), *scene, capture)
          : nullptr;
  const cnerf::RenderOptions render = cnerf::bench::field_options(*scene, average.get());
  const auto views = cnerf::bench::views_to_compare(capture, options["trained"] != 0, options["views"]);

  Sums all;
  cnerf::ContactSheet sheet({"bake", "field", "difference x 2"}, 1000);
  for (const cnerf::View* view : views) {
    const std::vector<float> bake_rgba = rgba_of(cnerf::bake::integrate_volumes(
        levels, view->intrinsics, view->world_from_camera, {options["percent_of_step"] / 100.0, options["rays"]}));
    const cnerf::RenderedImage field = scene->render(view->intrinsics, view->world_from_camera, render);
    const Sums sums = compare(bake_rgba, field, *view);
    print(view->name, sums);
    all.add(sums);
    if (options["pictures"] != 0) cnerf::bench::add_row(sheet, bake_rgba, field);
  }
  if (options["pictures"] != 0) write_png(bake / "bake_comparison.png", sheet.compose());
  print("all views", all);
  return views.empty() ? 65 : 0;
}
