#include "export/gltf_writer.h"

#include <gtest/gtest.h>
#include <tiny_gltf.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "export/bake_folder.h"
#include "export/texture_writer.h"
#include "export/up_axis.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/bake/analytic_field.h"
#include "tests/export/test_meshes.h"
#include "tests/export/test_volumes.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {
namespace fs = std::filesystem;

std::vector<bake::Camera> two_cameras() {
  bake::Camera a = camera_at("images/0001.jpg", {5, 2, 3}, {1, 2, 3}, 64, 48, 100);
  bake::Camera b = camera_at("images/0002.jpg", {1, 7, 4}, {1, 2, 3}, 64, 48, 100);
  return {a, b};
}

GltfScene scene_for(const bake::Mesh& mesh, const std::string& up = "z") {
  GltfScene scene;
  scene.cameras = two_cameras();
  scene.basecolor_png = basecolor_png(mesh.texture);
  scene.label = label_of_first(up);
  scene.lab_exr = "mesh_lab.exr";
  scene.vdb = "volume.vdb";
  return scene;
}

tinygltf::Model load(const fs::path& file) {
  tinygltf::TinyGLTF reader;
  tinygltf::Model model;
  std::string errors, warnings;
  const bool binary = file.extension() == ".glb";
  EXPECT_TRUE(binary ? reader.LoadBinaryFromFile(&model, &errors, &warnings, file.string())
                     : reader.LoadASCIIFromFile(&model, &errors, &warnings, file.string()));
  EXPECT_EQ(errors + warnings, "");
  return model;
}

std::vector<float> floats_of(const tinygltf::Model& model, int accessor) {
  const tinygltf::Accessor& a = model.accessors[std::size_t(accessor)];
  const tinygltf::BufferView& view = model.bufferViews[std::size_t(a.bufferView)];
  std::vector<float> values(view.byteLength / sizeof(float));
  std::memcpy(values.data(), model.buffers[0].data.data() + view.byteOffset, view.byteLength);
  return values;
}

TEST(Gltf, BothFormsHoldTheMeshYUp) {
  const TempDir folder;
  const bake::Mesh mesh = tetrahedron();
  const GltfFiles files = write_gltf(mesh, scene_for(mesh), folder.path(), "mesh");
  for (const fs::path& file : {files.gltf, files.glb}) {
    const tinygltf::Model model = load(file);
    const tinygltf::Primitive& primitive = model.meshes[0].primitives[0];
    const std::vector<float> positions = floats_of(model, primitive.attributes.at("POSITION"));
    ASSERT_EQ(positions.size(), 3 * mesh.positions.size());
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      EXPECT_EQ(positions[3 * v], mesh.positions[v].x);
      EXPECT_EQ(positions[3 * v + 1], mesh.positions[v].z);
      EXPECT_EQ(positions[3 * v + 2], -mesh.positions[v].y);
    }
    const tinygltf::Accessor& accessor = model.accessors[std::size_t(primitive.attributes.at("POSITION"))];
    EXPECT_EQ(accessor.minValues, (std::vector<double>{1, 3, -4}));
    EXPECT_EQ(accessor.maxValues, (std::vector<double>{2, 6, -2}));
    const std::vector<float> uvs = floats_of(model, primitive.attributes.at("TEXCOORD_0"));
    EXPECT_EQ(uvs[0], mesh.uvs[0].u);
    EXPECT_EQ(uvs[1], mesh.uvs[0].v) << "both have the origin at the upper left";
    EXPECT_TRUE(model.materials[0].extensions.count("KHR_materials_unlit"));
    EXPECT_EQ(model.extensionsUsed, std::vector<std::string>{"KHR_materials_unlit"});
    EXPECT_TRUE(model.extensionsRequired.empty());
    EXPECT_EQ(model.materials[0].extras.Get("cnerf").Get("lab_exr").Get<std::string>(), "mesh_lab.exr");
    EXPECT_EQ(model.nodes[0].extras.Get("cnerf").Get("vdb").Get<std::string>(), "volume.vdb");
    EXPECT_EQ(model.asset.extras.Get("cnerf").Get("take").Get<std::string>(), "first");
    EXPECT_EQ(model.images[0].width, 64);
  }
  EXPECT_GE(load(files.glb).images[0].bufferView, 0);
  EXPECT_EQ(load(files.gltf).images[0].uri, "mesh_basecolor.png");
}

/// A camera's node maps glTF camera axes to where the pixel rays of the capture go.
TEST(Gltf, CamerasLookWhereTheCaptureDid) {
  const TempDir folder;
  const bake::Mesh mesh = tetrahedron();
  for (const char* up : {"x", "y", "z"}) {
    const tinygltf::Model model = load(write_gltf(mesh, scene_for(mesh, up), folder.path(), "mesh").glb);
    ASSERT_EQ(model.cameras.size(), 1u) << "both share their intrinsics";
    EXPECT_NEAR(model.cameras[0].perspective.yfov, 2 * std::atan(24 / 100.0), 1e-12);
    EXPECT_NEAR(model.cameras[0].perspective.aspectRatio, 64.0 / 48, 1e-12);
    for (std::size_t c = 0; c < 2; ++c) {
      const tinygltf::Node& node = model.nodes[c + 1];
      const bake::Camera camera = two_cameras()[c];
      EXPECT_EQ(node.name, camera.name);
      const Vec3d q{node.rotation[0], node.rotation[1], node.rotation[2]};
      const auto turned = [&](Vec3d v) { return v + (cross(q, cross(q, v) + v * node.rotation[3])) * 2.0; };
      const Mat3d rotation = turned_up(up, "y").linear;
      const Vec3d forward = rotation * camera.world_from_camera.linear.column(2);
      const Vec3d down = rotation * camera.world_from_camera.linear.column(1);
      EXPECT_NEAR(length(turned({0, 0, -1}) - forward), 0, 1e-12);
      EXPECT_NEAR(length(turned({0, -1, 0}) - down), 0, 1e-12);
      const Vec3d at{node.translation[0], node.translation[1], node.translation[2]};
      EXPECT_NEAR(length(at - rotation * camera.world_from_camera.translation), 0, 1e-12);
    }
  }
}

TEST(Gltf, LengthsAreMetres) {
  const TempDir folder;
  const bake::Mesh mesh = tetrahedron();
  GltfScene scene = scene_for(mesh);
  const tinygltf::Model plain = load(write_gltf(mesh, scene, folder.path(), "mesh").glb);
  scene.label.world.metres_per_unit = 0.5;
  const tinygltf::Model model = load(write_gltf(mesh, scene, folder.path(), "mesh").glb);
  const auto values = [](const tinygltf::Model& of, const char* name) {
    return floats_of(of, of.meshes[0].primitives[0].attributes.at(name));
  };
  std::vector<float> halved = values(plain, "POSITION");
  for (float& value : halved) value /= 2;
  EXPECT_EQ(values(model, "POSITION"), halved);
  EXPECT_EQ(values(model, "NORMAL"), values(plain, "NORMAL"));
  const int positions = model.meshes[0].primitives[0].attributes.at("POSITION");
  EXPECT_EQ(model.accessors[std::size_t(positions)].maxValues, (std::vector<double>{1, 3, -1}));
  for (std::size_t node = 1; node < 3; ++node) {
    EXPECT_EQ(model.nodes[node].rotation, plain.nodes[node].rotation);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(model.nodes[node].translation[axis], plain.nodes[node].translation[axis] / 2);
    }
  }
  EXPECT_EQ(model.cameras[0].perspective.yfov, plain.cameras[0].perspective.yfov);
  EXPECT_EQ(model.cameras[0].perspective.znear, plain.cameras[0].perspective.znear / 2);
  EXPECT_EQ(model.cameras[0].perspective.zfar, plain.cameras[0].perspective.zfar / 2);
}

TEST(Gltf, CamerasSeeTheWholeOfAMeshFarFromThem) {
  const TempDir folder;
  bake::Mesh mesh = tetrahedron();
  for (Vec3f& position : mesh.positions) position.z += 100;
  const tinygltf::Model model = load(write_gltf(mesh, scene_for(mesh), folder.path(), "mesh").glb);
  EXPECT_GT(model.cameras[0].perspective.zfar, 110);
}

TEST(Gltf, UpTurnsToYByARotation) {
  const Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const char* names[3] = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    const Affined map = turned_up(names[axis], "y");
    EXPECT_EQ(map.direction(axes[axis]), (Vec3d{0, 1, 0}));
    EXPECT_EQ(map.linear.determinant(), 1);
    EXPECT_EQ(map.linear * map.linear.transposed(), Mat3d::identity());
  }
}

TEST(Gltf, TheBaseColourIsEncodedSrgb) {
  const std::vector<std::byte> png = basecolor_png(tetrahedron().texture);
  const cv::Mat bytes(1, int(png.size()), CV_8U, const_cast<std::byte*>(png.data()));
  const cv::Mat bgr = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(bgr.type(), CV_8UC3);
  EXPECT_EQ(bgr.at<cv::Vec3b>(0, 32), cv::Vec3b(188, 188, 188)) << "linear 0.5";
  EXPECT_EQ(bgr.at<cv::Vec3b>(1, 32)[0], 188) << "blue";
  EXPECT_EQ(bgr.at<cv::Vec3b>(1, 32)[1], 124) << "green, linear 0.2";
}

TEST(Gltf, ABrokenMeshIsRefusedAndLeavesNothing) {
  const TempDir folder;
  bake::Mesh mesh = tetrahedron();
  const GltfScene scene = scene_for(mesh);
  mesh.positions[2].y = std::nanf("");
  EXPECT_THROW(write_gltf(mesh, scene, folder.path(), "mesh"), ContractError);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(BakeFolder, TheManifestNamesEverythingThatWasWritten) {
  const TempDir folder;
  Label label = label_of_first("y", "feet");
  label.world.metres_per_unit = 0.3048;
  BakeFolder bake(folder.path(), two_cameras(), label);
  const bake::Volume volume = block_volume({4, 5, 6}, {12, 13, 14}, 2);
  bake.add_volumes({planes_of(volume)}, "volume", {});
  bake.add_mesh(tetrahedron(), "mesh", true);
  bake.finish();
  const BakeManifest manifest = read_manifest(bake.manifest());
  std::size_t others = 0;
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    if (entry.path() == bake.manifest()) continue;
    ++others;
    EXPECT_EQ(std::count(manifest.files.begin(), manifest.files.end(), entry.path().filename().string()), 1) << entry;
  }
  EXPECT_EQ(others, manifest.files.size());
  ASSERT_TRUE(manifest.volume && manifest.mesh);
  EXPECT_EQ(manifest.mesh->glb, "mesh.glb");
  EXPECT_EQ(manifest.mesh->lab_exr, "mesh_lab.exr");
  EXPECT_EQ(manifest.mesh->faces, 4u);
  EXPECT_EQ(manifest.mesh->bounds.min, (Vec3d{1, 2, 3}));
  EXPECT_EQ(manifest.mesh->bounds.max, (Vec3d{2, 4, 6}));
  EXPECT_EQ(manifest.mesh->gltf_from_world, (Affined{Mat3d::identity() * 0.3048, {}}));
  EXPECT_EQ(manifest.label.world.units, "feet");
  const auto json = nlohmann::json::parse(read_text_file(bake.manifest()));
  EXPECT_EQ(json["mesh"]["textures"]["rgb"]["space"], "lin_rec709");
  EXPECT_TRUE(json["mesh"].contains("world_from_gltf"));
  const tinygltf::Model model = load(folder / "mesh.glb");
  EXPECT_EQ(model.nodes[0].extras.Get("cnerf").Get("vdb").Get<std::string>(), "volume.vdb");
}

}  // namespace
}  // namespace cnerf::exporting::test
