// A baked mesh in the real Blender: renders held-out views of a capture (all views where none is held out) and compares
//   * the mesh with the field's own render of the view: silhouettes, and PSNR of sRGB-encoded colour over the pixels
//     that either covers, over those that both cover to 99 % (what texture and view dependence cost, without rims and
//     thin parts) and over the whole picture;
//   * the mesh with the volume of the same bake, where there is one: silhouettes.
// Both lie over black.
//
//   mesh_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=3] [samples=16] [volume=1]
//
// BAKE is the folder with manifest.json and blender_setup.py.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "export/manifest.h"
#include "src/capture/load_capture.h"
#include "src/train/scene.h"
#include "tests/bench/comparison_support.h"
#include "tests/blender/blender_run.h"

namespace {

using cnerf::bench::decibels;
using cnerf::bench::encoded;
using cnerf::bench::rgb_of;

using cnerf::test::RenderedExr;

struct Overlap {
  std::size_t both = 0, either = 0;
  void add(bool a, bool b) {
    both += a && b ? 1 : 0;
    either += a || b ? 1 : 0;
  }
  [[nodiscard]] double iou() const { return double(both) / double(std::max<std::size_t>(either, 1)); }
};

void compare(const RenderedExr& mesh, const cnerf::RenderedImage& field, const std::string& name) {
  const std::vector<float> rgb = rgb_of(field);
  double squared = 0, squared_inside = 0;
  std::size_t covered = 0, inside = 0;
  Overlap overlap;
  for (std::size_t p = 0; p < field.opacity.size(); ++p) {
    const float* m = &mesh.rgba[4 * p];
    overlap.add(m[3] > 0.5f, field.opacity[p] > 0.5f);
    if (std::max(m[3], field.opacity[p]) <= 0.01f) continue;
    double error = 0;
    for (std::size_t c = 0; c < 3; ++c) error += std::pow(encoded(m[c]) - encoded(rgb[3 * p + c]), 2);
    ++covered;
    squared += error;
    if (std::min(m[3], field.opacity[p]) < 0.99f) continue;
    ++inside;
    squared_inside += error;
  }
  std::printf(
      "%s: mesh against field %.2f dB over what they cover, %.2f dB inside (%.0f %% of it), %.2f dB over the "
      "picture, silhouettes IoU %.4f\n",
      name.c_str(), decibels(squared, 3 * covered), decibels(squared_inside, 3 * inside),
      100.0 * double(inside) / double(std::max<std::size_t>(covered, 1)), decibels(squared, 3 * field.opacity.size()),
      overlap.iou());
}

void compare(const RenderedExr& mesh, const RenderedExr& volume, const std::string& name) {
  Overlap overlap;
  for (std::size_t p = 0; p < mesh.rgba.size(); p += 4) overlap.add(mesh.rgba[p + 3] > 0.5f, volume.rgba[p + 3] > 0.5f);
  std::printf("%s: mesh against volume, silhouettes IoU %.4f\n", name.c_str(), overlap.iou());
}

}  // namespace

int main(int argc, char** argv) {
  auto [files, options] = cnerf::bench::parse_arguments(argc, argv, {{"views", 3}, {"samples", 16}, {"volume", 1}});
  if (files.size() < 3) {
    std::puts("mesh_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=N] [samples=N] [volume=0|1]");
    return 64;
  }
  const std::filesystem::path bake = files[0];
  const cnerf::Capture capture = cnerf::load_capture(files[1], {});
  const auto scene = cnerf::Scene::load(files[2], files.size() > 3 ? files[3] : "");
  const bool with_volume = options["volume"] != 0 && cnerf::read_manifest(bake / "manifest.json").volume.has_value();
  const bool any_held_out =
      std::any_of(capture.views.begin(), capture.views.end(), [](const auto& v) { return v.held_out; });
  cnerf::RenderOptions render;
  render.color = false;
  render.baked_color = scene->is_colorized();

  int done = 0;
  for (const cnerf::View& view : capture.views) {
    if ((any_held_out && !view.held_out) || done >= options["views"]) continue;
    ++done;
    const std::string look = "--camera '" + view.name + "' --samples " + std::to_string(options["samples"]);
    const RenderedExr mesh = cnerf::test::render_exact(bake / "blender_setup.py", look + " --mesh only");
    compare(mesh, scene->render(view.intrinsics, view.world_from_camera, render), view.name);
    if (with_volume) compare(mesh, cnerf::test::render_exact(bake / "blender_setup.py", look), view.name);
    std::fflush(stdout);
  }
  return done > 0 ? 0 : 65;
}
