#include "export/vdb_writer.h"

#include <gtest/gtest.h>
#include <nanovdb/util/IO.h>

#include <fstream>

#include "src/base/error.h"
#include "tests/export/test_volumes.h"
#include "tests/support/data.h"
#include "tests/support/full_disk.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
namespace {

/// The block with a value of its own in every voxel.
bake::Volume varied_block() {
  bake::Volume volume = block_volume({4, 5, 6}, {12, 13, 14}, 2);
  float number = 0;
  for (bake::Voxel& v : volume.voxels) {
    v.sigma = 2 + ++number / 8;
    v.rgb = {number / 1024, 0.5f, 0.25f};
    v.a = -number / 8;
  }
  return volume;
}

TEST(NanoVdb, HoldsTheGridsOfTheVdbWithTheirValues) {
  const TempDir folder;
  const bake::Volume volume = varied_block();
  write_nvdb(dilated(planes_of(volume), 2), folder / "a.nvdb", {.up = "y"}, label_of_first("z"));
  const auto handles = nanovdb::io::readGrids((folder / "a.nvdb").string());
  std::vector<std::string> names;
  for (const auto& handle : handles) names.emplace_back(handle.gridMetaData()->shortGridName());
  EXPECT_EQ(names, (std::vector<std::string>{"density", "color", "lab_a", "lab_b", "luminance"}));
  const auto* density = handles[0].grid<float>();
  const auto* color = handles[1].grid<nanovdb::Vec3f>();
  const auto* a = handles[2].grid<float>();
  ASSERT_TRUE(density != nullptr && color != nullptr && a != nullptr);
  EXPECT_TRUE(density->isFogVolume());
  const auto of_density = density->getAccessor(), of_a = a->getAccessor();
  const auto of_color = color->getAccessor();
  for (const bake::Voxel& v : volume.voxels) {
    const nanovdb::Coord at(v.i, v.j, v.k);
    ASSERT_EQ(of_density.getValue(at), v.sigma);
    ASSERT_EQ(of_a.getValue(at), v.a);
    ASSERT_EQ(of_color.getValue(at)[0], v.rgb.x);
    const Vec3d world = Vec3d{v.i + 0.5, v.j + 0.5, v.k + 0.5} * volume.voxel_size + volume.origin;
    const nanovdb::Vec3d there = density->indexToWorld(nanovdb::Vec3d(v.i, v.j, v.k));
    ASSERT_NEAR(there[0], world.x, 1e-12);
    ASSERT_NEAR(there[1], world.z, 1e-12) << "stands up";
    ASSERT_NEAR(there[2], -world.y, 1e-12);
  }
  EXPECT_EQ(of_density.getValue(nanovdb::Coord(2, 6, 7)), 0) << "color alone reaches here";
  EXPECT_NE(of_color.getValue(nanovdb::Coord(2, 6, 7))[1], 0);
  EXPECT_EQ(density->activeVoxelCount(), color->activeVoxelCount());
}

TEST(NanoVdb, AFolderThatCannotBeWrittenIsAnOutputError) {
  const TempDir folder;
  std::ofstream(folder / "file") << "not a folder";
  const bake::Volume volume = varied_block();
  EXPECT_THROW(write_nvdb(planes_of(volume), folder / "file" / "a.nvdb"), OutputError);
}

TEST(NanoVdb, ADiskThatIsFullOnTheWayIsAnOutputError) {
  const TempDir folder;
  const bake::Volume volume = varied_block();
  write_nvdb(planes_of(volume), folder / "whole.nvdb");
  const std::uintmax_t size = std::filesystem::file_size(folder / "whole.nvdb");
  for (const std::uintmax_t room : {std::uintmax_t(0), size / 2, size - 1}) {
    const FullDisk disk(room);
    EXPECT_THROW(write_nvdb(planes_of(volume), folder / "a.nvdb"), OutputError) << room;
    EXPECT_FALSE(std::filesystem::exists(folder / "a.nvdb"));
  }
}

}  // namespace
}  // namespace cnerf::exporting::test
