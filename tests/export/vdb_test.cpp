#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <tuple>

#include "bake/volume/openvdb_grids.h"
#include "export/vdb_reader.h"
#include "export/vdb_writer.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/parallel.h"
#include "tests/export/test_volumes.h"
#include "tests/support/data.h"
#include "tests/support/full_disk.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
namespace {
namespace fs = std::filesystem;

bake::Volume block(float sigma = 2) {
  return block_volume({4, 5, 6}, {12, 13, 14}, sigma);
}

openvdb::GridPtrVec read_grids(const fs::path& path) {
  openvdb::initialize();
  openvdb::io::File file(path.string());
  file.open(false);
  return *file.getGrids();
}

openvdb::GridBase::Ptr grid_named(const fs::path& path, const std::string& name) {
  for (const auto& grid : read_grids(path)) {
    if (grid->getName() == name) return grid;
  }
  return nullptr;
}

const VdbGridSummary& summary_named(const VdbSummary& summary, const std::string& name) {
  for (const VdbGridSummary& grid : summary.grids) {
    if (grid.name == name) return grid;
  }
  throw std::runtime_error("no grid " + name);
}

TEST(Vdb, GridsHaveTheirNamesTypesAndClasses) {
  const TempDir folder;
  write_dilated(block(), folder / "a.vdb");
  std::map<std::string, std::string> types;
  for (const auto& grid : read_grids(folder / "a.vdb")) {
    types[grid->getName()] = grid->valueType();
    EXPECT_EQ(grid->getGridClass(), openvdb::GRID_FOG_VOLUME);
    EXPECT_TRUE(grid->saveFloatAsHalf());
    EXPECT_FALSE(grid->getCreator().empty());
    EXPECT_EQ(grid->getVectorType(), openvdb::VEC_INVARIANT);  // the default for floats
  }
  const std::map<std::string, std::string> expected{
      {"density", "float"}, {"color", "vec3s"}, {"lab_a", "float"}, {"lab_b", "float"}, {"luminance", "float"}};
  EXPECT_EQ(types, expected);
}

TEST(Vdb, HoudiniGetsCdAsWell) {
  const TempDir folder;
  VdbOptions options;
  options.houdini = true;
  write_dilated(block(), folder / "a.vdb", options);
  ASSERT_NE(grid_named(folder / "a.vdb", "Cd"), nullptr);
  EXPECT_NE(grid_named(folder / "a.vdb", "color"), nullptr);
}

TEST(Vdb, AllGridsShareTheTransformAndTheActiveVoxels) {
  const TempDir folder;
  write_dilated(block(), folder / "a.vdb");
  const auto grids = read_grids(folder / "a.vdb");
  for (const auto& grid : grids) {
    EXPECT_EQ(grid->transform(), grids.front()->transform());
    EXPECT_EQ(grid->activeVoxelCount(), grids.front()->activeVoxelCount());
    EXPECT_EQ(grid->evalActiveVoxelBoundingBox(), grids.front()->evalActiveVoxelBoundingBox());
  }
}

TEST(Vdb, CentreRuleAndCornerRule) {
  const TempDir folder;
  VdbOptions corner;
  corner.voxel_origin = "corner";
  write_dilated(block(), folder / "center.vdb");
  write_dilated(block(), folder / "corner.vdb", corner);
  const auto at = [&](const char* file) {
    return grid_named(folder / file, "density")->indexToWorld(openvdb::Coord(0, 0, 0));
  };
  EXPECT_NEAR((at("center.vdb") - openvdb::Vec3d(1.025, 2.025, 3.025)).length(), 0, 1e-12);
  EXPECT_NEAR((at("corner.vdb") - openvdb::Vec3d(1, 2, 3)).length(), 0, 1e-12);
  EXPECT_NEAR(grid_named(folder / "center.vdb", "density")->voxelSize().x(), 0.05, 1e-15);
}

/// Every axis that can point up, in the poses' frame and in the file.
class VdbUp : public testing::TestWithParam<std::tuple<const char*, const char*>> {};

TEST_P(VdbUp, TheFileStandsUpAndComesBackAsItWas) {
  const auto [up_axis, up] = GetParam();
  const TempDir folder;
  VdbOptions options;
  options.up = up;
  const Label label = label_of_first(up_axis);
  write_dilated(block(), folder / "a.vdb", options, 2, label);
  const auto density = grid_named(folder / "a.vdb", "density");
  const auto position = [&](Vec3i at) { return density->indexToWorld(openvdb::Coord(at.x, at.y, at.z)); };
  Vec3i upwards{};
  upwards[*up_axis - 'x'] = 1;
  const openvdb::Vec3d step = position(upwards) - position({0, 0, 0});
  openvdb::Vec3d expected(0, 0, 0);
  expected[*up - 'x'] = 0.05;
  EXPECT_NEAR((step - expected).length(), 0, 1e-12);
  const Affined turn = file_from_world(options, label.world);
  EXPECT_NEAR(dot(turn.linear.rows[0], cross(turn.linear.rows[1], turn.linear.rows[2])), 1, 1e-15) << "not mirrored";
  const Vec3d first = turn.point({1.025, 2.025, 3.025});
  EXPECT_NEAR((position({0, 0, 0}) - openvdb::Vec3d(first.x, first.y, first.z)).length(), 0, 1e-12);
  EXPECT_EQ(summarize_vdb(folder / "a.vdb").metadata.at("up_axis"), up);
  const bake::Volume read = read_vdb(folder / "a.vdb");
  EXPECT_NEAR(length(read.origin - block().origin), 0, 1e-12) << "in the poses' frame again";
}

INSTANTIATE_TEST_SUITE_P(Axes, VdbUp, testing::Combine(testing::Values("x", "y", "z"), testing::Values("y", "z")),
                         [](const auto& axes) {
                           return std::string(std::get<0>(axes.param)) + "Becomes" + std::get<1>(axes.param);
                         });

TEST(Vdb, VoxelsThatLieAskewAreRefused) {
  const TempDir folder;
  openvdb::initialize();
  const auto grid = openvdb::FloatGrid::create();
  grid->setName("density");
  grid->tree().setValue(openvdb::Coord(0, 0, 0), 1);
  grid->transform().postRotate(0.3, openvdb::math::Z_AXIS);
  openvdb::io::File((folder / "a.vdb").string()).write({grid});
  EXPECT_THROW((void)read_vdb(folder / "a.vdb"), InputError);
}

class VdbDilation : public testing::TestWithParam<int> {};

TEST_P(VdbDilation, ColorReachesBeyondDensityAndDensityIsPadded) {
  const TempDir folder;
  const int reach = GetParam();
  const auto box = [](int margin) {  // around the block
    return openvdb::CoordBBox(4 - margin, 5 - margin, 6 - margin, 11 + margin, 12 + margin, 13 + margin);
  };
  write_dilated(block(), folder / "a.vdb", {}, reach);
  const auto density = openvdb::gridPtrCast<openvdb::FloatGrid>(grid_named(folder / "a.vdb", "density"));
  const auto color = openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid_named(folder / "a.vdb", "color"));
  EXPECT_EQ(density->evalActiveVoxelBoundingBox(), box(reach + 1));
  std::size_t corners = 0;
  for (auto it = density->cbeginValueOn(); it; ++it) {
    const openvdb::Coord at = it.getCoord();
    if (!box(reach).isInside(at)) {  // holds the box open, and nothing else
      EXPECT_EQ(*it, 0.0f);
      EXPECT_EQ(color->tree().getValue(at), openvdb::Vec3s(0));
      ++corners;
      continue;
    }
    EXPECT_EQ(*it, box(0).isInside(at) ? 2.0f : 0.0f) << at;
    EXPECT_NEAR(color->tree().getValue(at).z(), 0.8f, 5e-4f) << at;
  }
  EXPECT_EQ(corners, 2u);
  const auto side = static_cast<openvdb::Index64>(8 + 2 * reach);
  EXPECT_EQ(density->activeVoxelCount(), side * side * side + 2);
}
INSTANTIATE_TEST_SUITE_P(Vdb, VdbDilation, testing::Values(2, 3, 8));

TEST(Vdb, ReadsBackWhatWasWritten) {
  const TempDir folder;
  bake::Volume volume = block();
  volume.voxels.push_back({40, 5, 6, 7.25f, 0.1f, {0.1f, 0.11f, 0.12f}, 1, 2});  // apart from the rest
  write_dilated(volume, folder / "a.vdb");
  const bake::Volume read = read_vdb(folder / "a.vdb");
  EXPECT_NEAR(length(read.origin - volume.origin), 0, 1e-12);
  EXPECT_NEAR(read.voxel_size, volume.voxel_size, 1e-15);
  EXPECT_EQ(read.resolution, volume.resolution);
  EXPECT_EQ(read.frame, volume.frame);
  std::map<std::tuple<int, int, int>, bake::Voxel> found;
  for (const bake::Voxel& v : read.voxels) found[{v.i, v.j, v.k}] = v;
  for (const bake::Voxel& v : volume.voxels) {
    const bake::Voxel& r = found.at({v.i, v.j, v.k});
    EXPECT_EQ(r.sigma, v.sigma);  // both are halfs
    EXPECT_NEAR(length(r.rgb - v.rgb), 0, 5e-4);
    EXPECT_NEAR(r.luminance, v.luminance, 3e-4);
    EXPECT_NEAR(r.a, v.a, 2e-3);
    EXPECT_NEAR(r.b, v.b, 2e-2);
  }
  EXPECT_EQ(read.voxels.size(), 12u * 12 * 12 + 5u * 5 * 5 + 2);
}

TEST(Vdb, OneThreadOrSeveralWriteTheSame) {
  const TempDir folder;
  bake::Volume volume = block_volume({3, 5, 6}, {150, 9, 11}, 2);  // 19 planes of bricks
  for (bake::Voxel& voxel : volume.voxels) {
    voxel.sigma = 1 + float(voxel.i % 7);
    voxel.a = float(voxel.i - voxel.k);
  }
  bake::VolumePlanes planes = dilated(planes_of(volume), 2);
  set_thread_count(4);
  EXPECT_EQ(part_count(planes), 4u);
  write_vdb(planes, folder / "several.vdb");
  planes.is_sparing = true;
  EXPECT_EQ(part_count(planes), 1u);
  write_vdb(planes, folder / "one.vdb");
  set_thread_count(0);
  const bake::Volume several = read_vdb(folder / "several.vdb"), one = read_vdb(folder / "one.vdb");
  EXPECT_GT(several.voxels.size(), volume.voxels.size()) << "colours reach beyond";
  EXPECT_EQ(several.voxels, one.voxels);

  // Grids written at the same time lie, and say that they lie, where those written one by one do.
  constexpr std::size_t kUuid = 21, kBehindUuid = kUuid + 36;
  auto bytes = read_binary_file(folder / "several.vdb"), wanted = read_binary_file(folder / "one.vdb");
  ASSERT_EQ(bytes.size(), wanted.size());
  std::copy(wanted.begin() + kUuid, wanted.begin() + kBehindUuid, bytes.begin() + kUuid);
  EXPECT_EQ(bytes, wanted);
}

TEST(Vdb, HugeDensitiesStayFinite) {
  const TempDir folder;
  write_dilated(block(1e6f), folder / "a.vdb");
  const VdbSummary summary = summarize_vdb(folder / "a.vdb");
  const VdbGridSummary& density = summary_named(summary, "density");
  EXPECT_EQ(density.max_value, std::vector<double>{1e6});
  EXPECT_FALSE(density.half) << "a half would have been infinite";
  EXPECT_TRUE(summary_named(summary, "color").half);
}

TEST(Vdb, TinyDensitiesKeepTheirDigits) {
  const TempDir folder;
  write_dilated(block(1.2345e-7f), folder / "a.vdb");
  EXPECT_EQ(summary_named(summarize_vdb(folder / "a.vdb"), "density").max_value.at(0), double(1.2345e-7f));
}

TEST(Vdb, MetadataSaysWhatTheFileIs) {
  const TempDir folder;
  write_dilated(block(), folder / "a.vdb");
  const auto meta = summarize_vdb(folder / "a.vdb").metadata;
  EXPECT_EQ(meta.at("colorspace"), "lin_rec709");
  EXPECT_EQ(meta.at("white"), "D65");
  EXPECT_EQ(meta.at("voxel_origin"), "center");
  EXPECT_EQ(meta.at("color_origin"), "inferred by a colorizer");
  EXPECT_EQ(meta.at("colorizer"), "builtin");
  EXPECT_EQ(meta.at("take"), "first");
  for (const char* name : {"cnerf_version", "cnerf_world_to_source", "units", "up_axis"}) {
    EXPECT_TRUE(meta.count(name)) << name;
  }
}

TEST(Vdb, SummaryDescribesEveryGrid) {
  const TempDir folder;
  write_dilated(block(), folder / "a.vdb");
  const VdbSummary summary = summarize_vdb(folder / "a.vdb");
  const VdbGridSummary& color = summary_named(summary, "color");
  EXPECT_EQ(color.type, "vec3s");
  EXPECT_EQ(color.grid_class, "fog volume");
  EXPECT_EQ(color.active_voxels, 12u * 12 * 12 + 2);
  EXPECT_EQ(color.index_min, (Vec3i{1, 2, 3}));
  EXPECT_EQ(color.index_max, (Vec3i{14, 15, 16}));
  ASSERT_EQ(color.max_value.size(), 3u);
  EXPECT_NEAR(color.max_value[1], 0.5, 1e-3);
  EXPECT_EQ(summary_named(summary, "lab_b").min_value.at(0), -31.25);
  for (const VdbGridSummary& grid : summary.grids) {  // what is known of a grid without reading it
    EXPECT_EQ(grid.metadata.at("file_voxel_count"), "1730") << grid.name;
    EXPECT_EQ(grid.metadata.at("file_bbox_min"), "[1, 2, 3]") << grid.name;
    EXPECT_EQ(grid.metadata.at("file_bbox_max"), "[14, 15, 16]") << grid.name;
  }
}

TEST(Vdb, EveryCompressionReadsBack) {
  const TempDir folder;
  std::map<std::string, std::uintmax_t> bytes;
  for (const char* compression : {"blosc", "zip", "none"}) {
    VdbOptions options;
    options.compression = compression;
    write_dilated(block(), folder / "a.vdb", options);
    EXPECT_EQ(read_vdb(folder / "a.vdb").voxels.size(), 12u * 12 * 12 + 2) << compression;
    EXPECT_EQ(read_grids(folder / "a.vdb").size(), 5u) << "by OpenVDB's own reader";
    bytes[compression] = fs::file_size(folder / "a.vdb");
  }
  EXPECT_LT(bytes["zip"] + 10'000, bytes["none"]) << "of 24 kB of values; the rest is masks";
  EXPECT_LT(bytes["blosc"], bytes["none"]);
}

TEST(Vdb, RefusesValuesThatAreNone) {
  const TempDir folder;
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), -1.0f}) {
    EXPECT_THROW(write_dilated(block(bad), folder / "a.vdb"), ContractError) << bad;
  }
  bake::Volume volume = block();
  volume.voxels[3].rgb.y = std::nanf("");
  EXPECT_THROW(write_dilated(volume, folder / "a.vdb"), ContractError);
  EXPECT_THROW(write_dilated(bake::Volume{}, folder / "a.vdb"), ContractError);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Vdb, AFolderThatCannotBeWrittenIsAnOutputError) {
  const TempDir folder;
  std::ofstream(folder / "file") << "not a folder";
  EXPECT_THROW(write_dilated(block(), folder / "file" / "a.vdb"), OutputError);
  EXPECT_THROW(write_dilated(block(), fs::path("/proc/cnerf/a.vdb")), OutputError);
}

TEST(Vdb, AFullDiskIsAnOutputErrorAndLeavesNothing) {
  const TempDir folder;
  for (const rlim_t room : {rlim_t{0}, rlim_t{1000}, rlim_t{9000}}) {
    const test::FullDisk full(room);
    EXPECT_THROW(write_dilated(block(), folder / "a.vdb", {.compression = "none"}), OutputError) << room;
    EXPECT_TRUE(fs::is_empty(folder.path())) << room;
  }
}

TEST(Vdb, ReadingSaysWhatIsWrong) {
  const TempDir folder;
  EXPECT_THROW((void)read_vdb(folder / "missing.vdb"), MissingInputError);
  std::ofstream(folder / "text.vdb") << "hello";
  EXPECT_THROW((void)read_vdb(folder / "text.vdb"), InputError);
  EXPECT_THROW((void)summarize_vdb(folder / "text.vdb"), InputError);
  openvdb::initialize();
  openvdb::io::File(folder / "other.vdb").write({openvdb::FloatGrid::create()});
  EXPECT_THROW((void)read_vdb(folder / "other.vdb"), InputError);
}

}  // namespace
}  // namespace cnerf::exporting::test
