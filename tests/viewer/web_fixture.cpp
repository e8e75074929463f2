/// Writes what the tests of the page read, or the bundle of a bake:
///
///   web_fixture FOLDER                    bundle of a small coloured volume, and expected.json: what C++ says of it
///   web_fixture FOLDER BAKE RESOLUTION    bundle of a bake (VDB and manifest)

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "bake/volume/dilate.h"
#include "bake/volume/integrate.h"
#include "bake/volume/resample.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "export/web_bundle.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"

namespace cnerf {
using namespace exporting;
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// A ball of changing colour with a hole, beside a thin fog.
bake::Volume ball() {
  bake::Volume volume;
  volume.origin = {1, 2, 3};
  volume.voxel_size = 0.05;
  volume.resolution = {40, 36, 32};
  volume.frame = {{2, 2.9, 3.8}, 0.4, 1};
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 36; ++j)
      for (int k = 0; k < 32; ++k) {
        const double x = i - 17.5, y = j - 17.5, z = k - 15.5;
        const double r = std::sqrt(x * x + y * y + z * z);
        const bool fog = i >= 34;
        if (!fog && (r > 13 || (std::abs(x) < 3 && std::abs(y) < 3))) continue;
        const Vec3f rgb{float(0.15 + 0.8 * i / 40), float(0.1 + 0.6 * j / 36), float(0.9 - 0.8 * k / 32)};
        const Lab<float> lab = lab_from_linear_rgb(rgb);
        volume.voxels.push_back(
            {i, j, k, fog ? 0.4f : float(120.0 * (1.05 - r / 14)), luminance_of(rgb), rgb, lab.a, lab.b});
      }
  return volume;
}

bake::Camera camera(const std::string& name, Vec3d eye, Vec3d target) {
  const Vec3d forward = normalized(target - eye), right = normalized(cross(forward, Vec3d{0, 0, 1}));
  bake::Camera made{name, {LensModel::kPinhole, 160, 120, 190, 180, 84, 57, {}}, {}};
  made.world_from_camera = {Mat3d::from_columns(right, cross(forward, right), forward), eye};
  return made;
}

Json rows_of(const std::vector<float>& values) {
  Json list = Json::array();
  for (const float v : values) list.push_back(std::round(v * 1e5) / 1e5);
  return list;
}

void write_expected(const fs::path& file, const bake::Volume& volume, const std::vector<bake::Camera>& cameras) {
  Json projections = Json::array(), images = Json::array(), voxels = Json::array();
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (const Vec3d p : {Vec3d{1.5, 2.5, 3.5}, Vec3d{2.9, 3.7, 4.4}, Vec3d{1.9, 2.9, 3.8}}) {
      const auto pixel = project(cameras[c].intrinsics, cameras[c].world_from_camera.inverse().point(p));
      projections.push_back({{"camera", c}, {"point", {p.x, p.y, p.z}}, {"pixel", {pixel->x, pixel->y}}});
    }
    const bake::VolumeImage image = integrate_volume(volume, cameras[c].intrinsics, cameras[c].world_from_camera);
    images.push_back({{"width", image.width},
                      {"height", image.height},
                      {"rgb", rows_of(image.rgb)},
                      {"opacity", rows_of(image.opacity)}});
  }
  for (std::size_t v = 0; v < volume.voxels.size(); v += 997) {
    const bake::Voxel& voxel = volume.voxels[v];
    const Vec3d centre = volume.origin + Vec3d{voxel.i + 0.5, voxel.j + 0.5, voxel.k + 0.5} * volume.voxel_size;
    voxels.push_back({{"centre", {centre.x, centre.y, centre.z}},
                      {"sigma", voxel.sigma},
                      {"lightness", lightness_from_luminance(voxel.luminance)},
                      {"a", voxel.a},
                      {"b", voxel.b}});
  }
  write_file(file, Json{{"projections", projections}, {"voxels", voxels}, {"images", images}}.dump());
}

void write_small(const fs::path& folder) {
  const bake::Volume volume = ball();
  const std::vector<bake::Camera> cameras{camera("images/a.png", {-2, 2.5, 4.5}, {1.9, 2.9, 3.8}),
                                          camera("images/b.png", {2.2, -1.5, 5.2}, {1.9, 2.9, 3.8}),
                                          camera("images/c.png", {5.5, 4.5, 2.9}, {1.9, 2.9, 3.8})};
  std::vector<WebPhoto> photos;
  for (const bake::Camera& each : cameras) {
    const bake::VolumeImage seen = integrate_volume(volume, each.intrinsics, each.world_from_camera);
    std::vector<float> luminance;
    for (std::size_t p = 0; p < seen.opacity.size(); ++p) {
      luminance.push_back(luminance_of(Vec3f{seen.rgb[3 * p], seen.rgb[3 * p + 1], seen.rgb[3 * p + 2]}));
    }
    photos.push_back(make_web_photo(each.intrinsics, luminance, 160, 90));
  }
  const WebScene scene{"ball", cameras, photos, {{"reference:a.png", "warm", {"cnerf", "bake"}}, {"metres"}}};
  write_web_bundle(volume, make_web_bricks(volume), scene, folder / "r8", {});
  bake::Volume padded = volume;
  dilate_colors(padded, 3);
  write_expected(folder / "expected.json", padded, cameras);
}

void write_of_bake(const fs::path& folder, const fs::path& bake, int resolution) {
  const BakeManifest manifest = read_manifest(bake / "manifest.json");
  const bake::Volume volume = resample_volume(read_vdb(bake / manifest.volume->file), resolution);
  const WebBricks bricks = make_web_bricks(volume);
  const WebScene scene{bake.filename().string(), manifest.cameras, {}, manifest.label};
  const WebReport report = write_web_bundle(volume, bricks, scene, folder, {});
  std::printf("%zu voxels, %zu bricks, %.2f MiB\n", bricks.voxels, bricks.stored(),
              double(report.volume_bytes) / (1 << 20));
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  if (argc == 2) cnerf::write_small(argv[1]);
  if (argc == 4) cnerf::write_of_bake(argv[1], argv[2], std::stoi(argv[3]));
  return argc == 2 || argc == 4 ? 0 : 64;
}
