/// The frame of a capture survives the way into a bake: points of a COLMAP model land, through the cameras that a bake
/// names, where COLMAP's own formulas put them.

#include <gtest/gtest.h>
#include <tiny_gltf.h>

#include <sstream>

#include "export/bake_folder.h"
#include "export/manifest.h"
#include "export/up_axis.h"
#include "src/base/files.h"
#include "src/capture/load_capture.h"
#include "tests/capture/fixtures.h"
#include "tests/export/test_meshes.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
namespace {

constexpr double kTolerance = 1e-4;  // pixels

/// A line of images.txt: X_camera = R(q) X + t.
struct ColmapImage {
  double w, x, y, z;
  Vec3d t;
  std::string name;

  [[nodiscard]] Vec3d camera_from_world(Vec3d p) const {
    const Vec3d axis{x, y, z};
    return p + cross(axis, cross(axis, p) + p * w) * 2.0 + t;
  }
};

std::vector<ColmapImage> images_of(const std::string& text) {
  std::vector<ColmapImage> images;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    int id = 0, camera = 0;
    ColmapImage image;
    words >> id >> image.w >> image.x >> image.y >> image.z >> image.t.x >> image.t.y >> image.t.z >> camera >>
        image.name;
    if (words && image.name.find(".png") != std::string::npos) images.push_back(image);
  }
  return images;
}

/// COLMAP's OPENCV model: fx fy cx cy k1 k2 p1 p2.
PixelPosition colmap_pixel(Vec3d p, const std::vector<double>& c, bool distorted) {
  const double u = p.x / p.z, v = p.y / p.z, r2 = u * u + v * v;
  const double k1 = distorted ? c[4] : 0, k2 = distorted ? c[5] : 0, p1 = distorted ? c[6] : 0,
               p2 = distorted ? c[7] : 0;
  const double radial = 1 + k1 * r2 + k2 * r2 * r2;
  return {c[0] * (u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)) + c[2],
          c[1] * (v * radial + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)) + c[3]};
}

PixelPosition gltf_pixel(const tinygltf::Node& node, const tinygltf::Camera& camera, Vec3d in_gltf) {
  const Vec3d q{-node.rotation[0], -node.rotation[1], -node.rotation[2]};  // the inverse rotation
  const Vec3d away = in_gltf - Vec3d{node.translation[0], node.translation[1], node.translation[2]};
  const Vec3d p = away + cross(q, cross(q, away) + away * node.rotation[3]) * 2.0;  // looks along -Z, +Y up
  const auto extra = [&](const char* name) { return camera.extras.Get("cnerf").Get(name).GetNumberAsDouble(); };
  const double tangent = std::tan(camera.perspective.yfov / 2);
  const double fy = extra("height") / 2 / tangent;
  const double fx = extra("width") / 2 / (tangent * camera.perspective.aspectRatio);
  return {extra("cx") + fx * p.x / -p.z, extra("cy") + fy * p.y / p.z};
}

TEST(ExportedCameras, PointsOfAColmapModelLandOnTheirPixels) {
  const TempDir folder;
  const ColmapModel model{4, "OPENCV", {20, 21, 8.25, 5.75, 0.05, -0.02, 0.003, -0.001}, 4};
  write_colmap_images(folder / "capture/images");
  write_colmap_text(folder / "capture/sparse/0", model);
  std::vector<bake::Camera> cameras;
  for (const View& view : load_capture(folder / "capture").views) {
    cameras.push_back({view.name, view.intrinsics, view.world_from_camera});
  }
  BakeFolder bake(folder / "bake", cameras, {});
  const GltfFiles files = bake.add_mesh(tetrahedron(), "mesh", false);
  bake.finish();

  const BakeManifest manifest = read_manifest(bake.manifest());
  tinygltf::TinyGLTF reader;
  tinygltf::Model gltf;
  std::string errors, warnings;
  ASSERT_TRUE(reader.LoadBinaryFromFile(&gltf, &errors, &warnings, files.glb.string())) << errors;
  const std::vector<ColmapImage> images = images_of(read_text_file(folder / "capture/sparse/0/images.txt"));
  ASSERT_EQ(images.size(), 4u);
  int compared = 0;
  for (const ColmapImage& image : images) {
    const auto has_name = [&](const std::string& name) { return name.find(image.name) != std::string::npos; };
    const auto exported = std::ranges::find_if(manifest.cameras, [&](const auto& c) { return has_name(c.name); });
    const auto node =
        std::ranges::find_if(gltf.nodes, [&](const auto& n) { return n.camera >= 0 && has_name(n.name); });
    ASSERT_TRUE(exported != manifest.cameras.end() && node != gltf.nodes.end()) << image.name;
    for (const Vec3d p : {Vec3d{0, 0, 0}, {0.3, 0.1, -0.2}, {-0.2, 0.4, 0.3}, {0.1, -0.35, 0.25}}) {
      const Vec3d in_camera = image.camera_from_world(p);
      ASSERT_GT(in_camera.z, 0);
      const PixelPosition truth = colmap_pixel(in_camera, model.parameters, true);
      const auto pixel = project(exported->intrinsics, exported->world_from_camera.inverse().point(p));
      ASSERT_TRUE(pixel);
      EXPECT_NEAR(pixel->x, truth.x, kTolerance);
      EXPECT_NEAR(pixel->y, truth.y, kTolerance);
      const PixelPosition straight = colmap_pixel(in_camera, model.parameters, false);
      const PixelPosition seen = gltf_pixel(*node, gltf.cameras[node->camera], turned_up("z", "y").point(p));
      EXPECT_NEAR(seen.x, straight.x, kTolerance);
      EXPECT_NEAR(seen.y, straight.y, kTolerance);
      ++compared;
    }
  }
  EXPECT_EQ(compared, 16);
}

}  // namespace
}  // namespace cnerf::exporting::test
