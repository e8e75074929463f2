// A baked run in the real Blender: renders the held-out views of a capture in Cycles (linear EXR, box filter, volume
// step rate 0.25) and compares them with our own integrator on the same grids, with the capture's colours and, where
// snapshots are given, with the field's own render, over pixels whose opacity is above 0.01; with the field's render
// also over the whole picture, black where nothing is.
//
//   cycles_comparison BAKE CAPTURE [STAGE1.snapshot [TAKE.snapshot]] [views=3] [samples=64] [downscale=1] [holdout=0]
//
// BAKE is the folder with the VDB files, manifest.json and blender_setup.py.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "bake/volume_integrator.h"
#include "export/vdb_reader.h"
#include "src/capture/color_truth.h"
#include "src/capture/load_capture.h"
#include "src/train/scene.h"
#include "tests/bench/comparison_support.h"
#include "tests/blender/blender_run.h"

using cnerf::bench::decibels;
using cnerf::bench::encoded;

int main(int argc, char** argv) {
  auto [files, options] =
      cnerf::bench::parse_arguments(argc, argv, {{"views", 3}, {"samples", 64}, {"downscale", 1}, {"holdout", 0}});
  if (files.size() < 2) {
    std::puts(
        "cycles_comparison BAKE CAPTURE [STAGE1.snapshot [TAKE.snapshot]] [views=N] [samples=N] [downscale=N] "
        "[holdout=N]");
    return 64;
  }
  const std::filesystem::path bake = files[0];
  cnerf::CaptureOptions capture_options;
  capture_options.downscale = options["downscale"];
  capture_options.holdout = options["holdout"];
  const cnerf::Capture capture = cnerf::load_capture(files[1], capture_options);
  const std::vector<cnerf::BakedVolume> volumes = cnerf::read_volumes(bake);
  const auto scene = files.size() > 2 ? cnerf::Scene::load(files[2], files.size() > 3 ? files[3] : "") : nullptr;
  cnerf::RenderOptions render;
  render.color = false;
  render.baked_color = scene != nullptr && scene->is_colorized();

  int done = 0;
  for (const cnerf::View& view : capture.views) {
    if (!view.held_out || done >= options["views"]) continue;
    ++done;
    const cnerf::test::RenderedExr cycles = cnerf::test::render_exact(
        bake / "blender_setup.py",
        "--camera '" + view.name + "' --samples " + std::to_string(options["samples"]) + " --step-rate 0.25");
    const cnerf::VolumeImage ours = cnerf::integrate_volumes(volumes, view.intrinsics, view.world_from_camera);
    const auto truth = cnerf::load_color_truth(view);
    const auto field = scene ? scene->render(view.intrinsics, view.world_from_camera, render) : cnerf::RenderedImage{};
    double against_ours = 0, against_truth = 0, against_field = 0, picture = 0;
    std::size_t values = 0;
    for (int p = 0; p < ours.width * ours.height; ++p) {
      const float* rgba = &cycles.rgba[4 * std::size_t(p)];
      for (int c = 0; scene && c < 3; ++c) {
        const float wanted = render.baked_color ? field.baked_rgb[3 * std::size_t(p) + c] : field.luminance[p];
        picture += std::pow(encoded(rgba[c]) - encoded(wanted), 2);
      }
      if (std::max(rgba[3], ours.opacity[std::size_t(p)]) <= 0.01f) continue;
      for (int c = 0; c < 3; ++c, ++values) {
        const double difference = double(rgba[c]) - ours.rgb[3 * std::size_t(p) + c];
        against_ours += difference * difference;
        if (scene) {
          const float wanted = render.baked_color ? field.baked_rgb[3 * std::size_t(p) + c] : field.luminance[p];
          against_field += std::pow(encoded(rgba[c]) - encoded(wanted), 2);
        }
        if (!truth) continue;
        const double error = encoded(rgba[c]) - encoded(truth->rgb[3 * std::size_t(p) + c]);
        against_truth += error * error;
      }
    }
    std::printf("%s: Cycles against our integrator %.2f dB (linear)", view.name.c_str(),
                decibels(against_ours, values));
    if (scene) {
      std::printf(", against the field %.2f dB (sRGB; %.2f dB over the picture)", decibels(against_field, values),
                  decibels(picture, 3 * field.luminance.size()));
    }
    if (truth) std::printf(", against the true colours %.2f dB (sRGB)", decibels(against_truth, values));
    std::printf(", over %zu pixels\n", values / 3);
    std::fflush(stdout);
  }
  return done > 0 ? 0 : 65;
}
