/// Writes what the tests of the page read, or the bundle of a bake:
///
///   web_fixture FOLDER                    bundles of a small coloured volume and of nested grids, and what C++ says of
///                                         them: expected.json, nested.json
///   web_fixture FOLDER BAKE RESOLUTION    bundle of a bake (VDB and manifest)

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "bake/out_of_core/planes.h"
#include "bake/volume/dilate.h"
#include "bake/volume/integrate.h"
#include "export/manifest.h"
#include "export/vdb_reader.h"
#include "export/web_bundle.h"
#include "export/web_levels.h"
#include "src/base/files.h"
#include "src/color/colorspace_math.h"
#include "tests/export/test_volumes.h"

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

/// A ball of stripes, three coarse voxels to two of them, within thin fog: matter on both sides of every border.
void fill_stripes(bake::Volume& volume, Vec3i size, const bake::VoxelBox& hole) {
  volume.resolution = size;
  volume.frame = {{0, 0, 0}, 0.4, 1};
  for (int i = 0; i < size.x; ++i)
    for (int j = 0; j < size.y; ++j)
      for (int k = 0; k < size.z; ++k) {
        const auto in_hole = [&](int axis, int at) { return at >= hole.low[axis] && at < hole.high[axis]; };
        if (in_hole(0, i) && in_hole(1, j) && in_hole(2, k)) continue;
        const Vec3d p = volume.origin + Vec3d{i + 0.5, j + 0.5, k + 0.5} * volume.voxel_size;
        const double r = length(p);
        if (r > 1.25) continue;
        const bool is_light = std::fmod(p.x + 0.6 * p.y + 0.8 * p.z + 30, 0.3) < 0.15;
        const Vec3f rgb = is_light ? Vec3f{0.75f, 0.6f, 0.45f} : Vec3f{0.3f, 0.33f, 0.35f};
        const Lab<float> lab = lab_from_linear_rgb(rgb);
        const float sigma = r < 0.95 ? 9.0f : 0.5f;
        volume.voxels.push_back({i, j, k, sigma, luminance_of(rgb), rgb, lab.a, lab.b});
      }
}

constexpr double kCoarsest = 0.1;
constexpr int kAlong = 26;  ///< voxels of the coarsest

bake::Volume stripes(double voxel_size, Vec3d origin, Vec3i size, const bake::VoxelBox& hole) {
  bake::Volume volume;
  volume.voxel_size = voxel_size;
  volume.origin = origin;
  fill_stripes(volume, size, hole);
  return volume;
}

/// Three grids, finest first, each in a hole of the next one.
std::vector<bake::Volume> nested_stripes() {
  const Vec3d corner = Vec3d{-1, -1, -1} * (kAlong * kCoarsest / 2);
  const bake::VoxelBox hole{{2, 6, 5}, {18, 26, 19}}, inner{{1, 8, 6}, {16, 24, 20}};
  const Vec3d fine_corner = corner + hole.low.cast<double>() * kCoarsest;
  const Vec3d finest_corner = fine_corner + inner.low.cast<double>() * (kCoarsest / 2);
  return {stripes(kCoarsest / 4, finest_corner, inner.size() * 2, {}),
          stripes(kCoarsest / 2, fine_corner, hole.size() * 2, inner),
          stripes(kCoarsest, corner, {kAlong, kAlong, kAlong}, hole)};
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
    const bake::VolumeImage image =
        bake::integrate_volumes({&volume, 1}, cameras[c].intrinsics, cameras[c].world_from_camera);
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
    const bake::VolumeImage seen =
        bake::integrate_volumes({&volume, 1}, each.intrinsics, each.world_from_camera, {0.5, 2});
    std::vector<float> luminance;
    for (std::size_t p = 0; p < seen.opacity.size(); ++p) {
      luminance.push_back(luminance_of(Vec3f{seen.rgb[3 * p], seen.rgb[3 * p + 1], seen.rgb[3 * p + 2]}));
    }
    photos.push_back(exporting::test::make_web_photo(each.intrinsics, luminance, 160, 90));
  }
  const WebScene scene{"ball", cameras, photos, {{"reference:a.png", "warm", {"cnerf", "bake"}}, {"metres"}}};
  write_web_bundle({{make_web_bricks(volume)}, volume.frame, make_poster({&volume, 1}, cameras[0], 160)}, scene,
                   folder / "r8", {});
  bake::Volume padded = volume;
  dilate_colors(padded, 3);
  write_expected(folder / "expected.json", padded, cameras);
}

Json image_json(std::span<const bake::Volume> volumes, const bake::Camera& each) {
  const bake::VolumeImage image = integrate_volumes(volumes, each.intrinsics, each.world_from_camera, {0.5, 2});
  return {{"width", image.width}, {"height", image.height}, {"rgb", rows_of(image.rgb)}};
}

void write_nested(const fs::path& folder) {
  std::vector<bake::Volume> volumes = nested_stripes();
  // What the finest grid shows; where it ends, in the middle of the picture; all of it.
  const std::vector<bake::Camera> cameras{camera("images/inside.png", {-1.5, 0.1, -0.15}, {0, 0.1, -0.15}),
                                          camera("images/border.png", {-1.7, 0.9, -0.15}, {-0.8, 0.5, -0.15}),
                                          camera("images/all.png", {-2.4, 2.2, 1.6}, {0, 0, 0})};
  for (bake::Volume& volume : volumes) dilate_colors(volume, 2);
  Json images = Json::array();
  for (const bake::Camera& each : cameras) images.push_back(image_json(volumes, each));
  write_file(folder / "nested.json", Json{{"images", images}}.dump());
  const WebScene scene{"stripes", cameras, {}, {{"builtin", "", {"cnerf", "bake"}}, {"metres"}}};
  WebVolume volume{{}, volumes.back().frame, make_poster(volumes, cameras[0], 160)};
  volume.levels = make_web_levels(std::move(volumes), WebOptions{}.resolution);
  write_web_bundle(volume, scene, folder / "nested", {});
}

void write_of_bake(const fs::path& folder, const fs::path& bake, int resolution) {
  const BakeManifest manifest = read_manifest(bake / "manifest.json");
  std::vector<bake::Volume> volumes = read_volumes(bake);
  WebVolume volume{{}, volumes.back().frame, make_poster(volumes, manifest.cameras.front(), 640)};
  volume.levels = make_web_levels(std::move(volumes), resolution);
  const WebScene scene{bake.filename().string(), manifest.cameras, {}, manifest.label};
  const WebReport report = write_web_bundle(volume, scene, folder, {});
  for (const WebBricks& bricks : volume.levels) {
    std::printf("%zu voxels of %.4g, %zu bricks\n", bricks.voxels, bricks.voxel_size, bricks.stored());
  }
  std::printf("%.2f MiB\n", double(report.volume_bytes) / (1 << 20));
}

}  // namespace
}  // namespace cnerf

int main(int argc, char** argv) {
  if (argc == 2) {
    cnerf::write_small(argv[1]);
    cnerf::write_nested(argv[1]);
  }
  if (argc == 4) cnerf::write_of_bake(argv[1], argv[2], std::stoi(argv[3]));
  return argc == 2 || argc == 4 ? 0 : 64;
}
