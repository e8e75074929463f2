#include "src/sample/sample_scene.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/core.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "src/base/rng.h"
#include "src/capture/pose.h"
#include "src/picture/encode.h"
#include "src/picture/exr_writer.h"
#include "src/sample/scene.h"

namespace cnerf {
namespace fs = std::filesystem;
namespace {

using sample::PixelColor;

constexpr double kAngleOfView = 42;  ///< degrees, horizontal
constexpr double kDistance = 3.6;    ///< from the point all cameras look at
constexpr Vec3d kLookAt = {0, 0, 0.12}, kLookAtOutdoors = {0, 0, 0.75};
constexpr std::array<double, 3> kElevations = {20, 36, 53};  ///< degrees above the plate
constexpr std::array<double, 3> kElevationsOutdoors = {4, 10, 16};
constexpr double kOrbitElevation = 32, kOrbitElevationOutdoors = 10;
constexpr int kTestEvery = 8;
constexpr double kClothHeight = -0.1;
constexpr double kLeastDown = 1e-3;  // of a ray, per depth: above the horizon lies what is there
constexpr double kShadowDistance = 1.1, kShadowRadius = 0.7, kShadowDepth = 0.6;
constexpr double kExposureSpread = 0.3;
constexpr double kHaze = 8;  // depth at which it hides 63 % of the cloth
constexpr Vec3d kHorizonColor = {0.78, 0.82, 0.86}, kZenithColor = {0.24, 0.40, 0.72}, kCloudColor = {0.92, 0.92, 0.93};
constexpr std::uint64_t kExposureDraw = std::uint64_t(1) << 40;  // beyond those of pixels
constexpr int kFirstReference = 1, kReferences = 3;  // training views; the golden angle puts them around the scene

struct RenderedView {
  std::vector<PixelColor> color;  ///< [H, W]
  std::vector<float> depth;       ///< [H, W]
  std::vector<std::uint8_t> sky;  ///< [H, W] 1 where nothing is before it
};

Intrinsics camera_of(const SampleSceneOptions& options) {
  Intrinsics out;
  out.width = options.width;
  out.height = options.height;
  out.fx = out.fy = 0.5 * options.width / std::tan(0.5 * kAngleOfView * std::numbers::pi / 180);
  out.cx = 0.5 * options.width;
  out.cy = 0.5 * options.height;
  return out;
}

/// Cameras around the plate. Azimuths by the golden angle, so that any number of views is spread evenly, at elevations
/// in turn; or one turn at one elevation.
Affined pose_of(const SampleSceneOptions& options, int view) {
  const bool orbit = options.path == "orbit";
  const double step = orbit ? 2 * std::numbers::pi / options.views : std::numbers::pi * (3 - std::sqrt(5.0));
  const double azimuth = view * step - 0.5 * std::numbers::pi;
  const std::array<double, 3>& elevations = options.sky ? kElevationsOutdoors : kElevations;
  const double degrees = orbit && options.sky ? kOrbitElevationOutdoors
                         : orbit              ? kOrbitElevation
                                              : elevations[std::size_t(view) % elevations.size()];
  const double elevation = degrees * std::numbers::pi / 180;
  const Vec3d outward = {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                         std::sin(elevation)};
  const Vec3d forward = -outward;
  const Vec3d right = normalized(cross(forward, Vec3d{0, 0, 1}));
  const Vec3d eye = kLookAt + outward * kDistance;
  if (!options.sky) return {Mat3d::from_columns(right, cross(forward, right), forward), eye};
  const Vec3d ahead = normalized(kLookAtOutdoors - eye);
  return {Mat3d::from_columns(right, cross(ahead, right), ahead), eye};
}

std::string file_name(int view, const char* extension) {
  char name[32];
  std::snprintf(name, sizeof name, "view_%03d.%s", view, extension);
  return name;
}

/// The first view is a test view, then every eighth; a training set of fewer than two views would be none.
bool is_test_view(int view, int views) {
  return views > 2 && view % kTestEvery == 0;
}

/// Where a pixel's ray is at a depth along the axis.
Vec3d place_at(const Intrinsics& intrinsics, const Affined& pose, std::size_t pixel, double depth) {
  const std::size_t x = pixel % std::size_t(intrinsics.width), y = pixel / std::size_t(intrinsics.width);
  const Vec3d direction = ray_direction(intrinsics, {double(x) + 0.5, double(y) + 0.5});
  return pose.translation + pose.direction(direction / direction.z) * depth;
}

/// Depth of the cloth; that of the horizon for rays that go up.
double cloth_depth(const Intrinsics& intrinsics, const Affined& pose, std::size_t pixel) {
  const double down = pose.translation.z - place_at(intrinsics, pose, pixel, 1).z;
  return (pose.translation.z - kClothHeight) / std::max(down, kLeastDown);
}

/// Stripes in two directions, and blotches.
Vec3d cloth_at(Vec3d place) {
  const double stripes = 0.5 + 0.25 * std::sin(9 * place.x) + 0.25 * std::sin(7 * place.y + 2 * place.x);
  const double blotch = sample::noise(place * 6.0, 3);
  return Vec3d{0.34, 0.30, 0.26} * (0.4 + 0.6 * stripes) * (0.5 + blotch);
}

/// Pale at the horizon, blue above, with clouds.
Vec3d sky_at(Vec3d direction) {
  const double height = std::max(direction.z, 0.0);
  const Vec3d clear = kHorizonColor + (kZenithColor - kHorizonColor) * std::sqrt(height);
  const Vec3d dome = direction * (2 / (height + 0.35));
  const double cover = std::clamp((sample::noise({dome.x, dome.y, 0.5}, 3) - 0.45) / 0.3, 0.0, 1.0);
  return clear + (kCloudColor - clear) * (cover * cover * (3 - 2 * cover));
}

/// How much light reaches a place beside the photographer, who stands at `pose`.
double shadow_at(Vec3d place, const Affined& pose) {
  const Vec3d outward = normalized(Vec3d{pose.translation.x, pose.translation.y, 0});
  const double distance = length(Vec3d{place.x, place.y, 0} - outward * kShadowDistance);
  return 1 - kShadowDepth * std::exp(-std::pow(distance / kShadowRadius, 2));
}

void lay_on_cloth(const SampleSceneOptions& options, const Affined& pose, RenderedView& view) {
  const Intrinsics intrinsics = camera_of(options);
  for (std::size_t p = 0; p < view.color.size(); ++p) {
    PixelColor& color = view.color[p];
    const double depth = cloth_depth(intrinsics, pose, p);
    Vec3d cloth = cloth_at(place_at(intrinsics, pose, p, depth));
    if (options.sky) {
      const Vec3d direction = normalized(place_at(intrinsics, pose, p, 1) - pose.translation);
      const double clear = direction.z < 0 ? std::exp(-depth / kHaze) : 0;
      cloth = cloth * clear + sky_at(direction) * (1 - clear);
      if (direction.z >= 0 && color.alpha == 0) view.sky[p] = 1;
    }
    const Vec3d place = place_at(intrinsics, pose, p, view.depth[p] > 0 ? view.depth[p] : depth);
    const double light = options.moving_shadow ? shadow_at(place, pose) : 1;
    color = {(color.rgb + cloth * (1 - color.alpha)) * light, 1};
  }
}

void expose(double gain, RenderedView& view) {
  for (PixelColor& color : view.color) color.rgb = color.rgb * gain;
}

RenderedView render_view(const SampleSceneOptions& options, int view) {
  const Intrinsics intrinsics = camera_of(options);
  const Affined pose = pose_of(options, view);
  const int side = int(std::lround(std::sqrt(double(options.samples_per_pixel))));
  const CounterRng seeds(std::uint64_t(options.seed), std::uint64_t(view));
  RenderedView out;
  out.color.resize(std::size_t(options.width) * std::size_t(options.height));
  out.depth.resize(out.color.size());
  parallel_tasks(std::size_t(options.height), [&](std::size_t y) {
    if (interruption_requested()) return;
    for (std::size_t x = 0; x < std::size_t(options.width); ++x) {
      const std::size_t pixel = y * std::size_t(options.width) + x;
      out.color[pixel] = sample::render_pixel(intrinsics, pose, int(x), int(y), side, seeds.bits(pixel));
      out.depth[pixel] = sample::depth_of_pixel(intrinsics, pose, int(x), int(y));
    }
  });
  out.sky.resize(out.color.size(), 0);
  if (options.cloth || options.moving_shadow || options.sky) lay_on_cloth(options, pose, out);
  if (options.exposures) expose(1 + kExposureSpread * (2 * double(seeds.uniform(kExposureDraw)) - 1), out);
  return out;
}

/// B G R A of a pixel. PNG wants colours that are not multiplied by alpha.
cv::Vec4b stored_pixel(const PixelColor& color, bool grey) {
  if (color.alpha == 0) return {0, 0, 0, 0};
  Vec3d rgb = color.rgb / color.alpha;
  if (grey) rgb = Vec3d{1, 1, 1} * luminance_of(rgb);
  const double alpha = std::clamp(color.alpha, 0.0, 1.0);
  return {srgb8_from_linear(rgb.z), srgb8_from_linear(rgb.y), srgb8_from_linear(rgb.x),
          std::uint8_t(std::lround(alpha * 255))};
}

void write_picture(const fs::path& file, const SampleSceneOptions& options, const RenderedView& view, bool grey) {
  cv::Mat4b image(options.height, options.width);
  for (int i = 0; i < options.width * options.height; ++i) image(i) = stored_pixel(view.color[std::size_t(i)], grey);
  write_png(file, image);
}

void write_view(const fs::path& folder, const SampleSceneOptions& options, int index, const RenderedView& view) {
  write_picture(folder / "images" / file_name(index, "png"), options, view, /*grey=*/true);
  write_picture(folder / "color" / file_name(index, "png"), options, view, /*grey=*/false);
  if (options.sky) {
    cv::Mat1b sky(options.height, options.width);
    for (int i = 0; i < options.width * options.height; ++i) sky(i) = view.sky[std::size_t(i)] != 0 ? 255 : 0;
    write_png(folder / "sky" / file_name(index, "png"), sky);
  }
  write_exr(folder / "depth" / file_name(index, "exr"), {options.width, options.height, {{"Z", view.depth}}, {}});
}

nlohmann::ordered_json transforms_of(const SampleSceneOptions& options) {
  const Intrinsics camera = camera_of(options);
  const Aabbd box = sample::bounds();
  nlohmann::ordered_json out = {{"camera_model", "PINHOLE"}, {"w", camera.width}, {"h", camera.height},
                                {"fl_x", camera.fx},         {"fl_y", camera.fy}, {"cx", camera.cx},
                                {"cy", camera.cy},           {"aabb_scale", 1}};
  if (!options.sky) out["aabb"] = {{box.min.x, box.min.y, box.min.z}, {box.max.x, box.max.y, box.max.z}};
  out["train_filenames"] = nlohmann::json::array();
  out["test_filenames"] = nlohmann::json::array();
  for (int view = 0; view < options.views; ++view) {
    const std::string name = "images/" + file_name(view, "png");
    out[is_test_view(view, options.views) ? "test_filenames" : "train_filenames"].push_back(name);
    out["frames"].push_back({{"file_path", name}, {"transform_matrix", transforms_matrix(pose_of(options, view))}});
  }
  return out;
}

void check_options(const SampleSceneOptions& options) {
  const int side = int(std::lround(std::sqrt(double(options.samples_per_pixel))));
  if (options.samples_per_pixel < 1 || side * side != options.samples_per_pixel) {
    throw UsageError("samples_per_pixel: expected a square number, found " + std::to_string(options.samples_per_pixel));
  }
  if (options.views < 2 || options.views > 1000) {
    throw UsageError("views: expected 2 to 1000, found " + std::to_string(options.views));
  }
  if (options.width < 1 || options.height < 1) throw UsageError("width, height: expected at least one pixel");
}

}  // namespace

void write_sample_scene(const fs::path& folder, const SampleSceneOptions& options, const ProgressSink& progress) {
  check_options(options);
  for (int view = 0; view < options.views; ++view) {
    const RenderedView rendered = render_view(options, view);
    if (interruption_requested()) throw Interrupted("stopped; the capture is not finished");
    write_view(folder, options, view, rendered);
    if (view >= kFirstReference && view < kFirstReference + kReferences) {
      write_picture(folder / "references" / file_name(view, "png"), options, rendered, /*grey=*/false);
    }
    if (progress) progress({"sample", double(view + 1) / options.views, {}});
  }
  write_file(folder / "transforms.json", transforms_of(options).dump(1) + "\n");
}

}  // namespace cnerf
