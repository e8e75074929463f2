/// VDB files that were cut, mutated or made to do harm: read in a process of their own, they end as errors.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>

#include "bake/volume/openvdb_grids.h"
#include "export/bake_folder.h"
#include "export/vdb_reader.h"
#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/process.h"
#include "tests/bake/analytic_field.h"
#include "tests/export/test_volumes.h"
#include "tests/support/data.h"

namespace cnerf::exporting::test {
using namespace cnerf::test;
using namespace bake::test;
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

/// What reading says; empty when it is content. Anything but an error of ours fails the test.
std::string complaint(const fs::path& file) {
  try {
    (void)read_vdb(file);
    return "";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(file.filename().string()));
    return error.what();
  }
}

/// The same of a summary.
std::string complaint_of_summary(const fs::path& file) {
  try {
    (void)summarize_vdb(file);
    return "";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(file.filename().string()));
    return error.what();
  }
}

/// The most that a process we started and waited for has held.
std::size_t most_held_by_children() {
  rusage usage{};
  ::getrusage(RUSAGE_CHILDREN, &usage);
  return std::size_t(usage.ru_maxrss) << 10;
}
constexpr std::size_t kMostOfSummary = std::size_t(512) << 20;

/// A file with a density grid.
fs::path grid_file(const fs::path& file, const std::function<void(openvdb::FloatGrid&)>& fill) {
  openvdb::initialize();
  const auto grid = openvdb::FloatGrid::create();
  grid->setName("density");
  fill(*grid);
  openvdb::io::File(file.string()).write({grid});
  return file;
}

TEST(HostileVdb, BombsAreRefusedBeforeTheyAreVisited) {
  const TempDir folder;
  const fs::path tile = grid_file(folder / "tile.vdb", [](auto& grid) {
    grid.fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(4095)), 1, true);
  });
  const fs::path far = grid_file(folder / "far.vdb", [](auto& grid) {
    grid.tree().setValue(openvdb::Coord(-2'000'000'000), 1);
    grid.tree().setValue(openvdb::Coord(2'000'000'000), 1);
  });
  const fs::path apart = grid_file(folder / "apart.vdb", [](auto& grid) {
    grid.tree().setValue(openvdb::Coord(0), 1);
    grid.tree().setValue(openvdb::Coord(5000), 1);
  });
  EXPECT_LT(fs::file_size(tile), 2000u);
  EXPECT_THAT(complaint(tile), HasSubstr("in tiles"));
  EXPECT_THAT(complaint(far), HasSubstr("too far apart"));
  EXPECT_THAT(complaint(apart), HasSubstr("too far apart"));
  EXPECT_EQ(summarize_vdb(tile).grids.at(0).active_voxels, std::uint64_t(1) << 36) << "which may be said";
  EXPECT_LT(most_held_by_children(), kMostOfSummary);
}

TEST(HostileVdb, ValuesThatAreNoneAreRefusedByName) {
  const TempDir folder;
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), -1.0f}) {
    const fs::path file = grid_file(folder / "a.vdb", [&](auto& grid) {
      grid.tree().setValue(openvdb::Coord(1, 2, 3), 1);
      grid.tree().setValue(openvdb::Coord(4, 5, 6), bad);
    });
    EXPECT_THAT(complaint(file), testing::AllOf(HasSubstr("density"), HasSubstr("4, 5, 6"))) << bad;
    const VdbGridSummary summary = summarize_vdb(file).grids.at(0);
    EXPECT_EQ(summary.not_finite, bad == -1.0f ? 0u : 1u);
    EXPECT_EQ(summary.max_value.at(0), 1);
  }
}

TEST(HostileVdb, AnEmptyGridIsSaidToBe) {
  const TempDir folder;
  const fs::path file = grid_file(folder / "a.vdb", [](auto&) {});
  EXPECT_THAT(complaint(file), HasSubstr("no voxels"));
  EXPECT_EQ(summarize_vdb(file).grids.at(0).active_voxels, 0u);
}

TEST(HostileVdb, WhatIsNoFileIsNotReadFor) {
  const TempDir folder;
  fs::create_directories(folder / "folder.vdb");
  EXPECT_THROW((void)read_vdb(folder / "folder.vdb"), InputError);
  EXPECT_THROW((void)read_vdb(folder / (std::string(300, 'a') + ".vdb")), MissingInputError);
  write_file(folder / "none.vdb", std::string_view());
  EXPECT_NE(complaint(folder / "none.vdb"), "");
  write_dilated(block_volume({0, 0, 0}, {3, 3, 3}, 2), folder / "it's $(odd) \"name\".vdb");
  EXPECT_EQ(complaint(folder / "it's $(odd) \"name\".vdb"), "");
}

TEST(HostileVdb, FilesThatWereCutAreRefused) {
  const TempDir folder;
  write_dilated(block_volume({4, 5, 6}, {12, 13, 14}, 2), folder / "whole.vdb");
  const auto whole = read_binary_file(folder / "whole.vdb");
  for (int part = 0; part <= 12; ++part) {
    const std::size_t bytes = part == 12 ? whole.size() - 1 : whole.size() * std::size_t(part) / 12;
    write_file(folder / "cut.vdb", std::span(whole).first(bytes));
    EXPECT_NE(complaint(folder / "cut.vdb"), "") << bytes << " of " << whole.size();
    EXPECT_NE(complaint_of_summary(folder / "cut.vdb"), "") << bytes << " of " << whole.size();
  }
  EXPECT_LT(most_held_by_children(), kMostOfSummary);
}

/// Crashes of OpenVDB among them: the test process has to outlive them all.
TEST(HostileVdb, MutantsEndAsErrorsOrAsVolumes) {
  const TempDir folder;
  write_dilated(block_volume({4, 5, 6}, {12, 13, 14}, 2), folder / "whole.vdb");
  const auto whole = read_binary_file(folder / "whole.vdb");
  std::mt19937 random(1);
  int refused = 0;
  for (int mutant = 0; mutant < 40; ++mutant) {
    auto bytes = whole;
    for (int change = 0; change < 8; ++change) bytes[random() % bytes.size()] = std::byte(random() % 256);
    write_file(folder / "mutant.vdb", bytes);
    refused += complaint(folder / "mutant.vdb").empty() ? 0 : 1;
  }
  EXPECT_GT(refused, 5);
}

/// Files that crashed earlier versions, ate memory or did not end.
TEST(HostileVdb, FilesThatOnceDidHarmEndAsErrors) {
  CNERF_REQUIRE_DATA(archive, "hostile/hostile.tar.xz");
  const TempDir folder;
  if (run_program({"tar", "xJf", archive.string(), "-C", folder.path().string()}, folder / "log") != 0) {
    GTEST_SKIP() << "needs tar and xz";
  }
  int files = 0, refused = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder.path())) {
    if (!entry.is_regular_file() || entry.path().parent_path().filename() != "vdb") continue;
    ++files;
    (void)complaint_of_summary(entry.path());
    EXPECT_LT(most_held_by_children(), kMostOfSummary) << entry.path();
  }
  for (const auto& entry : fs::recursive_directory_iterator(folder.path())) {
    if (!entry.is_regular_file() || entry.path().parent_path().filename() != "vdb") continue;
    refused += complaint(entry.path()).empty() ? 0 : 1;
  }
  EXPECT_GE(files, 20);
  EXPECT_GE(refused, 20);
}

// ---- manifests ----------------------------------------------------------------------------------------------------

/// A bake in a folder.
void write_bake(const fs::path& folder) {
  BakeFolder bake(folder, {camera_at("a", {5, 5, 5}, {0, 0, 0}, 8, 8, 9)}, {});
  (void)bake.add_volumes({planes_of(block_volume({0, 0, 0}, {6, 6, 6}, 1))}, "volume", {});
  bake.finish();
}

template <typename Read>
std::string refusal_of(const Read& read) {
  try {
    read();
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

TEST(HostileManifest, AVolumeThatIsNotTheListedOneIsNotOpened) {
  const TempDir folder;
  write_bake(folder.path());
  EXPECT_EQ(read_volumes(folder.path()).size(), 1u);
  const auto read = [&] { (void)read_volumes(folder.path()); };
  auto bytes = read_binary_file(folder / "volume.vdb");
  bytes[bytes.size() / 2] ^= std::byte{1};
  write_file(folder / "volume.vdb", bytes);
  EXPECT_THAT(refusal_of(read), testing::AllOf(HasSubstr("SHA-256"), HasSubstr("manifest.json")));
  bytes.pop_back();
  write_file(folder / "volume.vdb", bytes);
  EXPECT_THAT(refusal_of(read), HasSubstr("manifest.json says"));
  fs::rename(folder / "volume.vdb", folder / "other.vdb");
  EXPECT_THROW(read(), MissingInputError);
  fs::create_symlink("/dev/zero", folder / "volume.vdb");
  EXPECT_THAT(refusal_of(read), HasSubstr("no file in this folder"));
}

TEST(HostileManifest, NamesThatLeadElsewhereAreNotOpened) {
  const TempDir folder;
  write_bake(folder / "bake");
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(read_text_file(folder / "bake" / "manifest.json"));
  for (const std::string& name :
       {std::string("../volume.vdb"), std::string("/etc/passwd"), std::string(300, 'a'), std::string("unlisted.vdb")}) {
    json["volume"]["file"] = name;
    if (name != "unlisted.vdb") json["files"][0]["name"] = name;
    write_file(folder / "bake" / "manifest.json", json.dump());
    EXPECT_NE(refusal_of([&] { (void)read_volumes(folder / "bake"); }), "") << name;
  }
}

TEST(HostileManifest, CamerasThatNothingCanBeRenderedForAreRefused) {
  const TempDir folder;
  write_bake(folder.path());
  const auto sound = nlohmann::ordered_json::parse(read_text_file(folder / "manifest.json"));
  const auto refusal_with = [&](const char* field, const nlohmann::ordered_json& value) {
    auto json = sound;
    json["cameras"][0][field] = value;
    write_file(folder / "manifest.json", json.dump());
    return refusal_of([&] { (void)read_manifest(folder / "manifest.json"); });
  };
  for (const int side : {-5, 0, 1'000'000'000, 32769})
    EXPECT_THAT(refusal_with("width", side), HasSubstr("cameras[0].width"));
  EXPECT_THAT(refusal_with("height", -5), HasSubstr("cameras[0]"));
  for (const double focal : {0.0, -9.0, 1e300})
    EXPECT_THAT(refusal_with("fx", focal), HasSubstr("cameras[0].focal length"));
  EXPECT_THAT(refusal_with("cx", 1e308), HasSubstr("cameras[0].principal point"));
  EXPECT_EQ(refusal_with("width", 8), "");
}

TEST(HostileManifest, OverwritingRemovesNothingOutside) {
  const TempDir folder;
  const fs::path bake = folder / "bake";
  write_file(folder / "victim", std::string_view("precious"));
  write_bake(bake);
  fs::create_directory_symlink("..", bake / "link");
  fs::create_symlink("../victim", bake / "to victim");
  write_file(bake / "former.exr", std::string_view("of the former bake"));
  auto json = nlohmann::ordered_json::parse(read_text_file(bake / "manifest.json"));
  for (const char* name :
       {"link/victim", "../victim", "a/../../victim", "", ".", "plates", "link", "to victim", "former.exr"}) {
    json["files"].push_back({{"name", name}, {"bytes", 8}, {"sha256", "00"}});
  }
  fs::create_directories(bake / "plates");
  write_file(bake / "manifest.json", json.dump());
  write_bake(bake);
  EXPECT_EQ(read_text_file(folder / "victim"), "precious");
  EXPECT_TRUE(fs::exists(bake / "plates"));
  EXPECT_FALSE(fs::exists(bake / "former.exr"));
}

}  // namespace
}  // namespace cnerf::exporting::test
