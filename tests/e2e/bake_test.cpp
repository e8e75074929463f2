/// cnerf bake that is stopped, runs out of disk or is not given enough memory.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"
#include "tests/support/sanitizers.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

std::vector<std::string> bake_into(const fs::path& folder) {
  return {"bake", tiny_run().string(), "-o", folder.string(), "--resolution", "64", "--progress", "json"};
}

/// A VDB from behind the identifier that OpenVDB draws at random for every file.
std::vector<std::byte> grids_of(const fs::path& vdb) {
  constexpr std::size_t kIdentifierEnds = 8 + 4 + 8 + 1 + 36;
  const auto bytes = read_binary_file(vdb);
  return {bytes.begin() + kIdentifierEnds, bytes.end()};
}

TEST(Bake, InterruptedOnesGoOnToTheSameBytes) {
  const TempDir folder;
  ASSERT_EQ(cnerf(bake_into(folder / "whole")).exit_code, 0);
  const ProgramResult stopped = cnerf_interrupted_at(bake_into(folder / "parts"), "\"bake\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  EXPECT_THAT(stopped.err, HasSubstr("the same command goes on"));
  EXPECT_THAT(files_below(folder / "parts"), testing::ElementsAre("unfinished.bake"));
  const ProgramResult resumed = cnerf(bake_into(folder / "parts"));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_THAT(resumed.out, HasSubstr("going on where it was stopped"));
  EXPECT_TRUE(grids_of(folder / "parts/volume.vdb") == grids_of(folder / "whole/volume.vdb"));
  EXPECT_EQ(files_below(folder / "parts"), files_below(folder / "whole"));
}

TEST(Bake, AMeshThatIsRefusedReplacesNothing) {
  const TempDir folder;
  ASSERT_EQ(cnerf(bake_into(folder / "bake")).exit_code, 0);
  std::vector<std::string> files = files_below(folder / "bake");
  const auto manifest = read_binary_file(folder / "bake/manifest.json");
  const std::vector<std::string> refused_mesh{"--format", "vdb,gltf", "--texture-size", "64", "--overwrite"};
  const ProgramResult refused = cnerf(concatenated(bake_into(folder / "bake"), refused_mesh));
  EXPECT_EQ(refused.exit_code, 64) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("hold no atlas"));
  EXPECT_TRUE(read_binary_file(folder / "bake/manifest.json") == manifest);
  files.emplace_back("unfinished.bake");
  EXPECT_THAT(files_below(folder / "bake"), testing::UnorderedElementsAreArray(files));
}

TEST(Bake, OtherOptionsBeginAnew) {
  for (const std::string option : {"bake.opacity_threshold=0.01", "bake.opacity_threshold=0.02", "finish.exposure=1"}) {
    const TempDir folder;
    const ProgramResult stopped = cnerf_with_file_limit(bake_into(folder / "parts"), 40'000);
    ASSERT_THAT(files_below(folder / "parts"), testing::ElementsAre("unfinished.bake")) << stopped.err;
    const ProgramResult other = cnerf(concatenated(bake_into(folder / "parts"), {"--set", option}));
    ASSERT_EQ(other.exit_code, 0) << other.err;
    const bool goes_on = other.out.find("going on where it was stopped") != std::string::npos;
    EXPECT_EQ(goes_on, option == "bake.opacity_threshold=0.01") << option << ", of which the first is the default";
  }
}

TEST(Bake, AFullDiskIsNamedAndLosesNothing) {
  const TempDir folder;
  const ProgramResult full = cnerf_with_file_limit(bake_into(folder / "bake"), 40'000);
  EXPECT_EQ(full.exit_code, 73) << full.err;
  EXPECT_THAT(full.err, HasSubstr("unfinished.bake"));
  EXPECT_THAT(files_below(folder / "bake"), testing::ElementsAre("unfinished.bake"));
  EXPECT_EQ(cnerf(bake_into(folder / "bake")).exit_code, 0);
}

TEST(Bake, TooLittleMemoryIsRefusedBeforeAnythingIsBaked) {
  const TempDir folder;
  const ProgramResult refused = cnerf(concatenated(bake_into(folder / "bake"), {"--max-memory", "10M"}));
  EXPECT_EQ(refused.exit_code, 64) << refused.err;
  EXPECT_THAT(refused.err, testing::AllOf(HasSubstr("max_memory"), HasSubstr("10M")));
  EXPECT_THAT(cnerf(concatenated(bake_into(folder / "bake"), {"--max-memory", "lots"})).err, HasSubstr("\"lots\""));
  EXPECT_TRUE(files_below(folder / "bake").empty());
  EXPECT_EQ(cnerf(concatenated(bake_into(folder / "bake"), {"--max-memory", "4G"})).exit_code, 0);
  const std::vector<std::string> splats{"--format", "vdb,splat", "--overwrite", "--aabb", "0,0,0,1,1,-1"};
  EXPECT_EQ(cnerf(concatenated(bake_into(folder / "bake"), splats)).exit_code, 64);
  EXPECT_TRUE(fs::exists(folder / "bake" / "manifest.json")) << "and nothing of what was there is replaced";
}

/// Where it runs out is chance: as a library is loaded, a thread begins, or in our own hands.
TEST(Bake, ALimitOfMemoryEndsWithAnAnswer) {
  if (kIsSanitized) GTEST_SKIP() << "sanitizers take more before they begin, and end a process that has none";
  const TempDir folder;
  int shortages = 0;
  for (int mebibytes = 44; mebibytes <= 88; mebibytes += 4) {
    const std::string limit = std::to_string(mebibytes) + "M";
    const ProgramResult result = cnerf(concatenated(bake_into(folder / limit), {"--max-memory", limit}));
    EXPECT_THAT(result.exit_code, testing::AnyOf(0, 64, 71)) << limit << ": " << result.err;
    if (result.exit_code == 71) ++shortages;
  }
  EXPECT_GT(shortages, 0);
}

TEST(Bake, ColorReachesAsFarAsAskedFor) {
  const TempDir folder;
  const auto size_of_volume = [&](const std::string& dilation) {
    const ProgramResult baked = cnerf(
        concatenated(bake_into(folder / dilation), {"--voxel-size", "0.04", "--set", "bake.dilation=" + dilation}));
    EXPECT_EQ(baked.exit_code, 0) << baked.err;
    return double(fs::file_size(folder / dilation / "volume.vdb"));
  };
  EXPECT_GT(size_of_volume("6"), 1.1 * size_of_volume("2"));  // of the same density; measured 1.18
}

}  // namespace
}  // namespace cnerf::test
