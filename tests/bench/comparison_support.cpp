#include "tests/bench/comparison_support.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <optional>

#include "src/base/error.h"
#include "src/capture/exr_io.h"
#include "src/capture/load_capture.h"
#include "src/picture/contact_sheet.h"

namespace cnerf::bench {
namespace {

/// The field over black, linear RGB; grey where it has no colour.  [H, W, 3]
std::vector<float> rgb_of(const RenderedImage& image) {
  if (!image.baked_rgb.empty()) return image.baked_rgb;
  std::vector<float> rgb;
  for (const float y : image.luminance) rgb.insert(rgb.end(), {y, y, y});
  return rgb;
}

/// The view-averaged field behind a bake, on lattices like its own.
std::unique_ptr<bake::ViewAverage> average_behind(const exporting::BakeManifest& bake, const Scene& scene,
                                                  const Capture& capture) {
  bake::Options options;
  options.voxel_size = bake.volume ? bake.volume->voxel_size : bake.mesh->voxel_size;
  options.grids = bake.finer_volumes.empty() ? "one" : "nested";
  Observer nobody;
  return make_view_average(scene, bake::cameras_of(capture), options, cpu_engines(), nobody);
}

/// A view of the field from a folder of its pictures.
RenderedImage read_render(const std::filesystem::path& folder, const View& view) {
  std::string name = std::filesystem::path(view.name).replace_extension(".exr").string();
  std::ranges::replace(name, '/', '_');
  LinearImage read = read_exr(folder / name);
  if (read.width != view.intrinsics.width || read.height != view.intrinsics.height) {
    throw InputError(folder / name, "size",
                     fmt::format("expected {} x {} as the view, found {} x {}", view.intrinsics.width,
                                 view.intrinsics.height, read.width, read.height));
  }
  RenderedImage image;
  image.width = read.width;
  image.height = read.height;
  image.baked_rgb = std::move(read.values);
  image.opacity = std::move(read.alpha);
  return image;
}

/// See compare_views; at most `most`.
std::vector<const View*> views_to_compare(const Capture& capture, bool trained, int most) {
  const bool any_held_out = std::ranges::any_of(capture.views, [](const View& view) { return view.held_out; });
  std::vector<const View*> candidates, chosen;
  for (const View& view : capture.views) {
    if (!any_held_out || view.held_out != trained) candidates.push_back(&view);
  }
  const std::size_t count = std::min(candidates.size(), std::size_t(most));
  for (std::size_t v = 0; v < count; ++v) chosen.push_back(candidates[trained ? v * candidates.size() / count : v]);
  return chosen;
}

void add_row(ContactSheet& sheet, std::span<const float> rgba, const RenderedImage& field) {
  const std::vector<float> wanted = rgb_of(field);
  std::vector<float> shown, difference;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    shown.push_back(rgba[4 * (i / 3) + i % 3]);
    const float more = 2 * (encoded(shown.back()) - encoded(wanted[i]));
    difference.push_back(linear_from_srgb(std::clamp(0.5f + more, 0.0f, 1.0f)));
  }
  const auto picture = [&](const std::vector<float>& rgb) {
    return picture_from_linear(field.width, field.height, rgb);
  };
  sheet.add_row({picture(shown), picture(wanted), picture(difference)});
}

}  // namespace

void Likeness::add(const float* rgba, const float* wanted, float opacity) {
  double error = 0;
  for (int c = 0; c < 3; ++c) error += std::pow(encoded(rgba[c]) - encoded(wanted[c]), 2);
  ++pixels_;
  squared_ += error;
  both_ += std::min(rgba[3], opacity) > 0.5f ? 1 : 0;
  either_ += std::max(rgba[3], opacity) > 0.5f ? 1 : 0;
  if (std::max(rgba[3], opacity) <= 0.01f) return;
  ++covered_;
  squared_covered_ += error;
  if (std::min(rgba[3], opacity) < 0.99f) return;
  ++inside_;
  squared_inside_ += error;
}

void Likeness::add(const Likeness& other) {
  squared_ += other.squared_;
  squared_covered_ += other.squared_covered_;
  squared_inside_ += other.squared_inside_;
  pixels_ += other.pixels_;
  covered_ += other.covered_;
  inside_ += other.inside_;
  both_ += other.both_;
  either_ += other.either_;
}

std::string Likeness::text() const {
  return fmt::format(
      "{:.2f} dB over what they cover, {:.2f} dB inside ({:.0f} % of it), {:.2f} dB over the picture, silhouettes IoU "
      "{:.4f}",
      covered(), inside(), 100.0 * double(inside_) / double(std::max<std::size_t>(covered_, 1)), picture(), overlap());
}

Likeness likeness_of(std::span<const float> rgba, const RenderedImage& field) {
  const std::vector<float> wanted = rgb_of(field);
  Likeness likeness;
  for (std::size_t p = 0; p < field.opacity.size(); ++p) likeness.add(&rgba[4 * p], &wanted[3 * p], field.opacity[p]);
  return likeness;
}

Arguments parse_arguments(int argc, char** argv, std::map<std::string, int> options) {
  Arguments parsed{{}, std::move(options)};
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const std::size_t equals = argument.find('=');
    if (equals == std::string::npos) {
      parsed.files.push_back(argument);
    } else {
      parsed.options.at(argument.substr(0, equals)) = std::stoi(argument.substr(equals + 1));
    }
  }
  return parsed;
}

RenderedImage Comparison::field_of(const View& view) const {
  if (!renders.empty()) return read_render(renders, view);
  RenderOptions render;
  render.color = false;
  render.baked_color = scene->is_colorized();
  if (average) render.luminance = [this](auto positions, auto luminance) { average->query(positions, luminance); };
  return scene->render(view.intrinsics, view.world_from_camera, render);
}

int compare_views(int argc, char** argv, const std::string& name, std::map<std::string, int> options,
                  const std::function<std::vector<float>(Comparison&, const View&, const RenderedImage*)>& each) {
  options.merge(std::map<std::string, int>{{"views", 3},
                                           {"downscale", 1},
                                           {"holdout", 0},
                                           {"trained", 0},
                                           {"averaged", 0},
                                           {"pinhole", 0},
                                           {"pictures", 0}});
  const auto [files, chosen] = parse_arguments(argc, argv, options);
  if (files.size() < 2) {
    std::printf("%s_comparison BAKE CAPTURE [STAGE1.snapshot [TAKE.snapshot] | RENDERS]", name.c_str());
    for (const auto& [key, value] : options) std::printf(" [%s=%d]", key.c_str(), value);
    std::puts("");
    return 64;
  }
  CaptureOptions capture;
  capture.downscale = chosen.at("downscale");
  capture.holdout = chosen.at("holdout");
  Comparison comparison{files[0],
                        {},
                        chosen,
                        exporting::read_manifest(std::filesystem::path(files[0]) / "manifest.json"),
                        load_capture(files[1], capture),
                        nullptr,
                        nullptr};
  if (files.size() > 2 && std::filesystem::is_directory(files[2])) {
    comparison.renders = files[2];
  } else if (files.size() > 2) {
    comparison.scene = Scene::load(files[2], files.size() > 3 ? files[3] : "", cpu_engines());
    if (chosen.at("averaged") != 0) {
      comparison.average = average_behind(comparison.manifest, *comparison.scene, comparison.capture);
    }
  }
  for (View& view : comparison.capture.views) {
    if (chosen.at("pinhole") != 0) view.intrinsics = exporting::without_distortion(view.intrinsics);
  }
  const auto views = views_to_compare(comparison.capture, chosen.at("trained") != 0, chosen.at("views"));
  ContactSheet sheet({name, "field", "difference x 2"}, 1000);
  for (const View* view : views) {
    std::optional<RenderedImage> field;
    if (comparison.has_field()) field = comparison.field_of(*view);
    const std::vector<float> rgba = each(comparison, *view, field ? &*field : nullptr);
    std::fflush(stdout);
    if (chosen.at("pictures") != 0 && field) add_row(sheet, rgba, *field);
  }
  if (chosen.at("pictures") != 0) write_png(comparison.bake / (name + "_comparison.png"), sheet.compose());
  return views.empty() ? 65 : 0;
}

}  // namespace cnerf::bench
