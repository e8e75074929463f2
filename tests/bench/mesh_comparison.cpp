// A baked mesh in the real Blender: renders held-out views of a capture (all views where none is held out) and compares
//   * the mesh with the field's own render of the view: silhouettes, and PSNR of sRGB-encoded colour over the pixels
//     that either covers and over the whole picture;
//   * the mesh with the volume of the same bake, where there is one: silhouettes.
// Both lie over black.
//
//   mesh_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=3] [samples=16] [volume=1]
//
// BAKE is the folder with manifest.json and blender_setup.py.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>

#include "export/manifest.h"
#include "src/capture/load_capture.h"
#include "src/color/colorspace_math.h"
#include "src/train/scene.h"
#include "tests/blender/blender_run.h"

namespace {

using cnerf::test::RenderedExr;

double encoded(float linear) {
  return cnerf::srgb_from_linear(std::clamp(linear, 0.0f, 1.0f));
}

double decibels(double squared, std::size_t values) {
  return -10 * std::log10(std::max(squared / double(std::max<std::size_t>(values, 1)), 1e-12));
}

struct Overlap {
  std::size_t both = 0, either = 0;
  void add(bool a, bool b) {
    both += a && b ? 1 : 0;
    either += a || b ? 1 : 0;
  }
  [[nodiscard]] double iou() const { return double(both) / double(std::max<std::size_t>(either, 1)); }
};

/// The field over black, linear RGB; grey where it has no colour.
std::vector<float> rgb_of(const cnerf::RenderedImage& image) {
  if (!image.baked_rgb.empty()) return image.baked_rgb;
  std::vector<float> rgb;
  for (const float y : image.luminance) rgb.insert(rgb.end(), {y, y, y});
  return rgb;
}

void compare(const RenderedExr& mesh, const cnerf::RenderedImage& field, const std::string& name) {
  const std::vector<float> rgb = rgb_of(field);
  double squared = 0;
  std::size_t covered = 0;
  Overlap overlap;
  for (std::size_t p = 0; p < field.opacity.size(); ++p) {
    const float* m = &mesh.rgba[4 * p];
    overlap.add(m[3] > 0.5f, field.opacity[p] > 0.5f);
    if (std::max(m[3], field.opacity[p]) <= 0.01f) continue;
    ++covered;
    for (std::size_t c = 0; c < 3; ++c) squared += std::pow(encoded(m[c]) - encoded(rgb[3 * p + c]), 2);
  }
  std::printf("%s: mesh against field %.2f dB over what they cover, %.2f dB over the picture, silhouettes IoU %.4f\n",
              name.c_str(), decibels(squared, 3 * covered), decibels(squared, 3 * field.opacity.size()), overlap.iou());
}

void compare(const RenderedExr& mesh, const RenderedExr& volume, const std::string& name) {
  Overlap overlap;
  for (std::size_t p = 0; p < mesh.rgba.size(); p += 4) overlap.add(mesh.rgba[p + 3] > 0.5f, volume.rgba[p + 3] > 0.5f);
  std::printf("%s: mesh against volume, silhouettes IoU %.4f\n", name.c_str(), overlap.iou());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::puts("mesh_comparison BAKE CAPTURE STAGE1.snapshot [TAKE.snapshot] [views=N] [samples=N] [volume=0|1]");
    return 64;
  }
  const std::filesystem::path bake = argv[1];
  std::filesystem::path take;
  std::map<std::string, int> options = {{"views", 3}, {"samples", 16}, {"volume", 1}};
  for (int i = 4; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    if (equals == std::string::npos) {
      take = argument;
    } else {
      options.at(argument.substr(0, equals)) = std::stoi(argument.substr(equals + 1));
    }
  }
  const cnerf::Capture capture = cnerf::load_capture(argv[2], {});
  const auto scene = cnerf::Scene::load(argv[3], take);
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
