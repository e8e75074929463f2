#include "export/manifest.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "export/bake_folder.h"
#include "export/vdb_reader.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "tests/bake/analytic_field.h"
#include "tests/export/test_volumes.h"
#include "tests/export/whole_export.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {

nlohmann::json exported(const TempDir& folder) {
  bake::Camera camera = camera_at("images/0001.jpg", {5, 2, 3}, {1, 2, 3}, 64, 48, 100);
  camera.intrinsics.model = LensModel::kOpenCv;
  camera.intrinsics.distortion[1] = 0.25;
  export_volume(block_volume({4, 5, 6}, {12, 13, 14}, 2), {camera}, folder / "out", "scene");
  return nlohmann::json::parse(read_text_file(folder / "out" / "manifest.json"));
}

TEST(Manifest, ListsFilesWithSizesAndHashes) {
  const TempDir folder;
  const nlohmann::json j = exported(folder);
  ASSERT_EQ(j["files"].size(), 2u);
  for (const auto& file : j["files"]) {
    const auto content = read_binary_file(folder / "out" / file["name"].get<std::string>());
    EXPECT_EQ(file["bytes"], content.size());
    EXPECT_EQ(file["sha256"], sha256(content));
  }
}

TEST(Manifest, SaysWhatTheBakeIs) {
  const TempDir folder;
  const nlohmann::json j = exported(folder);
  EXPECT_EQ(j["schema"], kManifestSchema);
  EXPECT_EQ(j["command_line"], (std::vector<std::string>{"cnerf", "bake", "run"}));
  EXPECT_EQ(j["color"]["space"], "lin_rec709");
  EXPECT_EQ(j["color"]["inferred"], true);
  EXPECT_EQ(j["color"]["colorizer"], "builtin");
  EXPECT_EQ(j["color"]["take"], "first");
  EXPECT_NEAR(j["volume"]["bounds"]["min"][0].get<double>(), 1 + 4 * 0.05, 1e-12);
  EXPECT_NEAR(j["volume"]["bounds"]["max"][2].get<double>(), 3 + 14 * 0.05, 1e-12);
  EXPECT_EQ(j["volume"]["voxels"], 512);
  EXPECT_EQ(j["volume"]["voxel_origin"], "center");
}

TEST(Manifest, TransformsAreInverseAndAgreeWithTheFrame) {
  const TempDir folder;
  const nlohmann::json frame = exported(folder)["frame"];
  const auto apply = [](const nlohmann::json& m, Vec3d p) {
    Vec3d q;
    for (int i = 0; i < 3; ++i) {
      q[i] = m[i][0].get<double>() * p.x + m[i][1].get<double>() * p.y + m[i][2].get<double>() * p.z +
             m[i][3].get<double>();
    }
    return q;
  };
  const SceneFrame expected{{1.5, 2.5, 3.5}, 0.125, 2};
  const Vec3d p{0.3, -4, 7};
  EXPECT_NEAR(length(apply(frame["unit_from_world"], p) - expected.unit_from_world(p)), 0, 1e-12);
  EXPECT_NEAR(length(apply(frame["world_from_unit"], apply(frame["unit_from_world"], p)) - p), 0, 1e-12);
}

TEST(Manifest, ReadsBack) {
  const TempDir folder;
  (void)exported(folder);
  const BakeManifest manifest = read_manifest(folder / "out" / "manifest.json");
  EXPECT_EQ(manifest.files, (std::vector<std::string>{"scene.vdb", "blender_setup.py"}));
  EXPECT_EQ(manifest.frame, (SceneFrame{{1.5, 2.5, 3.5}, 0.125, 2}));
  ASSERT_EQ(manifest.cameras.size(), 1u);
  const bake::Camera expected = camera_at("images/0001.jpg", {5, 2, 3}, {1, 2, 3}, 64, 48, 100);
  EXPECT_EQ(manifest.cameras[0].name, expected.name);
  EXPECT_EQ(manifest.cameras[0].intrinsics.model, LensModel::kOpenCv);
  EXPECT_EQ(manifest.cameras[0].intrinsics.distortion[1], 0.25);
  EXPECT_EQ(manifest.cameras[0].world_from_camera, expected.world_from_camera);
  ASSERT_TRUE(manifest.volume.has_value());
  EXPECT_EQ(manifest.volume->resolution, (Vec3i{16, 17, 18}));
}

TEST(Manifest, RefusesNewerSchemasAndBrokenFiles) {
  const TempDir folder;
  nlohmann::json j = exported(folder);
  j["schema"] = kManifestSchema + 1;
  std::ofstream(folder / "newer.json") << j;
  EXPECT_THROW((void)read_manifest(folder / "newer.json"), InputError);
  j["schema"] = std::int64_t(1) << 32;
  std::ofstream(folder / "newer.json") << j;
  EXPECT_THROW((void)read_manifest(folder / "newer.json"), InputError);
  j["schema"] = kManifestSchema;
  j.erase("cameras");
  std::ofstream(folder / "short.json") << j;
  EXPECT_THROW((void)read_manifest(folder / "short.json"), InputError);
  std::ofstream(folder / "text.json") << "{";
  EXPECT_THROW((void)read_manifest(folder / "text.json"), InputError);
  EXPECT_THROW((void)read_manifest(folder / "none.json"), MissingInputError);
}

void expect_refusal(const TempDir& folder, const nlohmann::json& bad, const std::string& field) {
  std::ofstream(folder / "bad.json") << bad;
  try {
    (void)read_manifest(folder / "bad.json");
    ADD_FAILURE() << field;
  } catch (const InputError& refusal) {
    EXPECT_NE(std::string(refusal.what()).find("bad.json: cameras[0]." + field + ":"), std::string::npos)
        << refusal.what();
  }
}

TEST(Manifest, CamerasThatCannotBeAreRefused) {
  const TempDir folder;
  const nlohmann::json good = exported(folder);
  for (const auto& [column, value] : {std::pair{0, 1e308}, {1, -2.5}, {3, 1e308}, {3, -1e10}}) {
    nlohmann::json bad = good;
    bad["cameras"][0]["world_from_camera"][1][column] = value;
    std::ofstream(folder / "bad.json") << bad;
    expect_refusal(folder, bad, column == 3 ? "position" : "world_from_camera");
  }
  const auto with = [&](const char* key, const nlohmann::json& value) {
    nlohmann::json bad = good;
    bad["cameras"][0][key] = value;
    return bad;
  };
  nlohmann::json five = good["cameras"][0]["world_from_camera"];
  five[1].push_back(0.0);
  expect_refusal(folder, with("world_from_camera", five), "world_from_camera");
  expect_refusal(folder, with("width", (std::int64_t(1) << 32) + 8), "width");
  expect_refusal(folder, with("fx", 1e308), "focal length");
  expect_refusal(folder, with("cx", -1e308), "principal point");
  expect_refusal(folder, with("name", std::string(5000, 'a')), "name");
}

TEST(Manifest, AMissingFileIsNotListed) {
  const TempDir folder;
  BakeManifest manifest;
  manifest.files = {"nowhere.vdb"};
  EXPECT_THROW(write_manifest(manifest, folder.path()), MissingInputError);
}

TEST(BakeFolder, NestedGridsAreListedAndReadBackFinestFirst) {
  const TempDir folder;
  const bake::Volume coarse = block_volume({0, 0, 0}, {6, 6, 6}, 1, 0.1),
                     fine = block_volume({0, 0, 0}, {4, 4, 4}, 2, 0.05);
  VdbOptions options;
  options.usd = true;
  BakeFolder bake(folder.path(), {camera_at("a", {5, 5, 5}, {0, 0, 0}, 8, 8, 9)}, label_of_first("y", "cm"));
  const auto files = bake.add_volumes({planes_of(fine), planes_of(coarse)}, "volume", options);
  bake.add_plate("images/a.png", std::vector<std::byte>(7));
  bake.finish();
  EXPECT_EQ(files.size(), 3u);
  const std::vector<bake::Volume> read = read_volumes(folder.path());
  ASSERT_EQ(read.size(), 2u);
  EXPECT_NEAR(read[0].voxel_size, 0.05, 1e-12);
  EXPECT_NEAR(read[1].voxel_size, 0.1, 1e-12);
  const BakeManifest manifest = read_manifest(bake.manifest());
  EXPECT_EQ(manifest.plates.count("a"), 0u) << "plates belong to cameras by their full names";
  const std::string usd = read_text_file(folder / "volume.usda");
  for (const char* part : {"@./volume.vdb@", "@./volume_fine1.vdb@", "upAxis = \"Y\"", "token fieldName = \"lab_b\""}) {
    EXPECT_NE(usd.find(part), std::string::npos) << part;
  }
}

TEST(BakeFolder, PlatesOfNamesThatAreAlikeAreFilesOfTheirOwn) {
  const TempDir folder;
  BakeFolder bake(folder.path(), {}, {});
  for (const char* name : {"shot.0001", "shot.0002", "a/b.jpg", "a_b.jpg", "a_b.png"}) {
    bake.add_plate(name, std::vector<std::byte>(7));
  }
  for (const char* file : {"shot.0001", "shot.0002", "a_b", "a_b_", "a_b__"}) {
    EXPECT_TRUE(std::filesystem::exists(folder / "plates" / (std::string(file) + ".jpg"))) << file;
  }
}

TEST(BakeFolder, APlateOfALongNameHasItsLastWholeLetters) {
  const TempDir folder;
  std::string letters;
  for (int i = 0; i < 150; ++i) letters += "ä";
  BakeFolder(folder.path(), {}, {}).add_plate(letters + "x", std::vector<std::byte>(7));
  EXPECT_TRUE(std::filesystem::exists(folder / "plates" / (letters.substr(letters.size() - 2 * 74) + "x.jpg")));
}

TEST(BakeFolder, ASkyIsReplacedWithTheFirstOfTheOtherFiles) {
  const TempDir folder;
  const bake::Volume volume = block_volume({0, 0, 0}, {4, 4, 4}, 2);
  const auto begun = [&](float light) {
    auto bake = std::make_unique<BakeFolder>(folder.path(), std::vector<bake::Camera>(), Label());
    bake->add_sky({2, 1, std::vector<float>(6, light)});
    return bake;
  };
  const auto first = begun(0.5f);
  first->add_volumes({planes_of(volume)}, "volume", {});
  first->finish();
  const auto second = begun(0.25f);
  EXPECT_NO_THROW(check_listed_file(read_manifest(first->manifest()), folder.path(), "sky.exr"));
  second->add_volumes({planes_of(volume)}, "volume", {});
  second->finish();
  EXPECT_NO_THROW(check_listed_file(read_manifest(first->manifest()), folder.path(), "sky.exr"));
}

TEST(BakeFolder, AStoppedSecondBakeLeavesNoManifestThatNamesItsFiles) {
  const TempDir folder;
  const bake::Volume volume = block_volume({0, 0, 0}, {4, 4, 4}, 2);
  const auto begun = [&](std::size_t grids) {
    auto bake = std::make_unique<BakeFolder>(folder.path(), std::vector<bake::Camera>(), Label());
    bake->add_volumes(std::vector<bake::VolumePlanes>(grids, planes_of(volume)), "volume", {});
    return bake;
  };
  begun(2)->finish();
  EXPECT_FALSE(std::filesystem::exists(begun(1)->manifest()));
  begun(1)->finish();
  EXPECT_FALSE(std::filesystem::exists(folder / "volume_fine1.vdb")) << "of the first";
  EXPECT_FALSE(std::filesystem::exists(folder / ".former-manifest.json"));
}

TEST(BakeFolder, ASecondBakeLeavesNothingOfTheFirst) {
  const TempDir folder;
  const bake::Volume volume = block_volume({0, 0, 0}, {4, 4, 4}, 2);
  std::ofstream(folder / "mine.txt") << "not of a bake";
  BakeFolder first(folder.path(), {}, {});
  first.add_volumes({planes_of(volume), planes_of(volume)}, "volume", {});
  first.add_plate("images/a.png", std::vector<std::byte>(7));
  first.finish();
  EXPECT_TRUE(std::filesystem::exists(folder / "plates" / "images_a.jpg"));
  BakeFolder second(folder.path(), {}, {});
  second.add_volumes({planes_of(volume)}, "volume", {});
  second.finish();
  EXPECT_TRUE(std::filesystem::exists(folder / "volume.vdb"));
  EXPECT_TRUE(std::filesystem::exists(folder / "mine.txt"));
  EXPECT_FALSE(std::filesystem::exists(folder / "volume_fine1.vdb"));
  EXPECT_FALSE(std::filesystem::exists(folder / "plates" / "images_a.jpg"));
}

}  // namespace
}  // namespace cnerf::exporting::test
