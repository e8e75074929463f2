// What a bake keeps of its field: held-out views of a capture (all views where none is held out; with trained=1 those
// that are not, evenly spread), rendered from the baked voxels by our own integrator, against
//   * the field's render of the view: PSNR of sRGB-encoded colour;
//   * the photograph: PSNR of sRGB-encoded luminance, beside that of the field.
// All over black.
//
//   bake_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=3] [downscale=1] [holdout=0] [rays=2]
//                   [percent_of_step=50] [trained=0]
//
// BAKE is a folder with manifest.json. `rays` are those along each axis of a pixel.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "bake/volume_integrator.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "src/train/scene.h"
#include "tests/bench/comparison_support.h"

namespace {

using cnerf::bench::decibels;
using cnerf::bench::encoded;

struct Sums {
  double color = 0, bake_photo = 0, field_photo = 0;
  std::size_t pixels = 0;
};

void print(const std::string& name, const Sums& sums) {
  std::printf("%s: bake against field %.2f dB; luminance against the photograph: bake %.2f dB, field %.2f dB\n",
              name.c_str(), decibels(sums.color, 3 * sums.pixels), decibels(sums.bake_photo, sums.pixels),
              decibels(sums.field_photo, sums.pixels));
  std::fflush(stdout);
}

/// The first held-out views (of all views where none is), or trained ones, evenly spread.
std::vector<const cnerf::View*> views_to_compare(const cnerf::Capture& capture, bool trained, std::size_t most) {
  const bool any_held_out =
      std::any_of(capture.views.begin(), capture.views.end(), [](const auto& v) { return v.held_out; });
  std::vector<const cnerf::View*> candidates, chosen;
  for (const cnerf::View& view : capture.views) {
    if (!any_held_out || view.held_out != trained) candidates.push_back(&view);
  }
  most = std::min(most, candidates.size());
  for (std::size_t v = 0; v < most; ++v) chosen.push_back(candidates[trained ? v * candidates.size() / most : v]);
  return chosen;
}

}  // namespace

int main(int argc, char** argv) {
  auto [files, options] = cnerf::bench::parse_arguments(
      argc, argv,
      {{"views", 3}, {"downscale", 1}, {"holdout", 0}, {"rays", 2}, {"percent_of_step", 50}, {"trained", 0}});
  if (files.size() < 3) {
    std::puts(
        "bake_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=N] [downscale=N] [holdout=N] "
        "[rays=N] [percent_of_step=N] [trained=0|1]");
    return 64;
  }
  cnerf::CaptureOptions capture_options;
  capture_options.downscale = options["downscale"];
  capture_options.holdout = options["holdout"];
  const cnerf::Capture capture = cnerf::load_capture(files[1], capture_options);
  const auto scene = cnerf::Scene::load(files[2], files.size() > 3 ? files[3] : "");
  const std::vector<cnerf::BakedVolume> levels = cnerf::read_volumes(files[0]);
  const auto views = views_to_compare(capture, options["trained"] != 0, std::size_t(options["views"]));
  cnerf::RenderOptions render;
  render.color = false;
  render.baked_color = scene->is_colorized();

  Sums mean;
  for (const cnerf::View* compared : views) {
    const cnerf::View& view = *compared;
    const cnerf::VolumeImage ours = cnerf::integrate_volumes(levels, view.intrinsics, view.world_from_camera,
                                                             {options["percent_of_step"] / 100.0, options["rays"]});
    const cnerf::RenderedImage field = scene->render(view.intrinsics, view.world_from_camera, render);
    Sums sums;
    sums.pixels = field.luminance.size();
    for (std::size_t p = 0; p < sums.pixels; ++p) {
      const float* rgb = &ours.rgb[3 * p];
      const double photo = encoded(view.image.luminance(p));
      for (std::size_t c = 0; c < 3; ++c) {
        const float wanted = field.baked_rgb.empty() ? field.luminance[p] : field.baked_rgb[3 * p + c];
        sums.color += std::pow(encoded(rgb[c]) - encoded(wanted), 2);
      }
      sums.bake_photo += std::pow(encoded(cnerf::luminance_of(cnerf::Vec3f{rgb[0], rgb[1], rgb[2]})) - photo, 2);
      sums.field_photo += std::pow(encoded(field.luminance[p]) - photo, 2);
    }
    print(view.name, sums);
    mean.color += sums.color;
    mean.bake_photo += sums.bake_photo;
    mean.field_photo += sums.field_photo;
    mean.pixels += sums.pixels;
  }
  print("all views", mean);
  return views.empty() ? 65 : 0;
}
