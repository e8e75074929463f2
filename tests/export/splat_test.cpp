/// The files of splats: what stands in them, and where.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>

#include "export/bake_output.h"
#include "export/splat_writer.h"
#include "src/base/error.h"
#include "src/base/rng.h"
#include "tests/export/splat_files.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using bake::test::file_splat;
namespace {

bake::SplatCloud cloud_of(int count, float reach = 3) {
  SequentialRng rng(5, named_stream("files"));
  bake::SplatCloud cloud;
  cloud.frame = {{1, 2, 3}, 0.25, 1};
  for (int i = 0; i < count; ++i) {
    bake::Splat splat;
    splat.position = {rng.uniform(-reach, reach), rng.uniform(-1, 1), rng.uniform(0, 2)};
    splat.log_scale = {rng.uniform(-7, 1), rng.uniform(-7, 1), rng.uniform(-7, 1)};
    float square = 0;
    for (float& part : splat.rotation) square += std::pow(part = rng.normal(), 2.0f);
    for (float& part : splat.rotation) part /= std::sqrt(square);
    splat.opacity_logit = rng.uniform(-4, 5);
    splat.color = {rng.uniform(), rng.uniform(), rng.uniform()};
    for (float& part : splat.shading) part = rng.uniform(-0.5f, 0.5f);
    cloud.splats.push_back(splat);
  }
  return cloud;
}
Label label() {
  return {{"reference:\"warm\".png", "first", {"cnerf", "bake"}}, {}};
}

TEST(SplatPly, HoldsTheUsualPropertiesInTheUsualOrder) {
  const std::string text = splat_ply(cloud_of(2), "a comment");
  std::string expected =
      "ply\nformat binary_little_endian 1.0\ncomment a comment\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float f_dc_0\n"
      "property float f_dc_1\nproperty float f_dc_2\n";
  for (int i = 0; i < 24; ++i) expected += "property float f_rest_" + std::to_string(i) + "\n";
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    expected += std::string("property float ") + name + "\n";
  }
  expected += "end_header\n";
  EXPECT_EQ(text.substr(0, expected.size()), expected);
  EXPECT_EQ(text.size(), expected.size() + 2 * 41 * sizeof(float));
}

TEST(SplatPly, ReadsBackExactly) {
  const TempDir folder;
  const bake::SplatCloud cloud = cloud_of(50);
  const auto read = read_splat_ply(write_splats(cloud, folder.path(), "splats", label()).ply);
  ASSERT_EQ(read.size(), 50u);
  for (std::size_t i = 0; i < read.size(); ++i) {
    const FileSplat wanted = file_splat(cloud.splats[i]);
    EXPECT_EQ(read[i].position, wanted.position);
    EXPECT_EQ(read[i].log_scale, wanted.log_scale);
    EXPECT_EQ(read[i].rotation, wanted.rotation);
    EXPECT_EQ(read[i].opacity_logit, wanted.opacity_logit);
    for (std::size_t k = 0; k < 9; ++k) EXPECT_LT(length(read[i].harmonics[k] - wanted.harmonics[k]), 1e-5);
  }
}

TEST(SplatSpz, ReadsBackToItsPrecision) {
  const TempDir folder;
  const bake::SplatCloud cloud = cloud_of(300);
  const auto read = read_splat_spz(write_splats(cloud, folder.path(), "splats", label()).spz);
  ASSERT_EQ(read.size(), 300u);
  const double place = std::ldexp(1.0, -spz_fraction_bits(cloud));
  EXPECT_LE(place, 1.0 / (1 << 20));
  for (std::size_t i = 0; i < read.size(); ++i) {
    const FileSplat wanted = file_splat(cloud.splats[i]);
    double along = 0;
    for (std::size_t k = 0; k < 4; ++k) along += read[i].rotation[k] * wanted.rotation[k];
    EXPECT_GT(std::abs(along), 1 - 5e-6);  // 10 bits a part
    const auto opacity = [](double logit) { return 1 / (1 + std::exp(-logit)); };
    EXPECT_NEAR(opacity(read[i].opacity_logit), opacity(wanted.opacity_logit), 0.5 / 255 + 1e-6);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(read[i].position[c], wanted.position[c], place);
      EXPECT_NEAR(read[i].log_scale[c], wanted.log_scale[c], 0.5 / 16 + 1e-6);
      EXPECT_NEAR(read[i].harmonics[0][c], wanted.harmonics[0][c], 0.5 / 255 / 0.15 + 1e-6);
      for (std::size_t k = 1; k < 9; ++k) {
        EXPECT_NEAR(read[i].harmonics[k][c], wanted.harmonics[k][c], (k < 4 ? 2.5 : 4.5) / 128);
      }
    }
  }
}

TEST(SplatSpz, FarSplatsKeepFewerBits) {
  EXPECT_EQ(spz_fraction_bits(cloud_of(100, 3)), 20);
  EXPECT_LT(spz_fraction_bits(cloud_of(100, 3000)), 12);
  EXPECT_THROW((void)splat_spz(cloud_of(100, 1e8f)), ContractError);
}

TEST(SplatUsd, IsOneParticleFieldWithAsManyValuesAsSplats) {
  bake::SplatCloud cloud = cloud_of(3);
  cloud.splats[0].position = {0.5f, -0.25f, 2};
  const std::string text = splat_usd(cloud, label());
  EXPECT_EQ(text.find("#usda 1.0\n"), 0u);
  EXPECT_NE(text.find("def ParticleField3DGaussianSplat \"splats\""), std::string::npos);
  EXPECT_NE(text.find("point3f[] positions = [(0.5, -0.25, 2), ("), std::string::npos) << text;
  EXPECT_NE(text.find("uniform int radiance:sphericalHarmonicsDegree = 2"), std::string::npos);
  const auto vectors = [&](const std::string& name) {
    const std::size_t begin = text.find(name + " = ["), end = text.find(']', begin + name.size() + 4);
    const std::string array = text.substr(begin, end - begin);
    return std::ranges::count(array, '(');
  };
  EXPECT_EQ(vectors("positions"), 3);
  EXPECT_EQ(vectors("orientations"), 3);
  EXPECT_EQ(vectors("scales"), 3);
  EXPECT_EQ(vectors("radiance:sphericalHarmonicsCoefficients"), 27);
  EXPECT_NE(text.find("take first"), std::string::npos) << "does not say where its colours come from";
}

TEST(SplatFolder, TheManifestListsTheFilesAndABakeOfSplatsAloneNeedsNoBlender) {
  const TempDir folder;
  BakeFolder bake(folder.path(), {}, label());
  const bake::SplatCloud cloud = cloud_of(7);
  bake.add_splats(cloud, "splats");
  bake.finish();
  const BakeManifest manifest = read_manifest(folder / "manifest.json");
  ASSERT_TRUE(manifest.splats);
  EXPECT_EQ(manifest.splats->count, 7u);
  EXPECT_EQ(manifest.splats->degree, 2);
  EXPECT_EQ(manifest.frame, cloud.frame);
  EXPECT_EQ(manifest.files, (std::vector<std::string>{"splats.ply", "splats.spz", "splats.usda"}));
  EXPECT_FALSE(std::filesystem::exists(folder / "blender_setup.py"));
  EXPECT_NO_THROW(check_listed_file(manifest, folder.path(), "splats.spz"));
}

TEST(SplatFormat, IsOneOfTheFormats) {
  EXPECT_TRUE(parse_formats("splat").has_only_splats());
  EXPECT_TRUE(parse_formats("splat").has_manifest());
  EXPECT_FALSE(parse_formats("splat").is_for_blender());
  EXPECT_FALSE(parse_formats("vdb,splat").has_only_splats());
  EXPECT_THROW((void)parse_formats("splats"), UsageError);
}

}  // namespace
}  // namespace cnerf::exporting::test
