/// Whole runs on a tiny capture.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

nlohmann::json json_of(const fs::path& file) {
  return nlohmann::json::parse(read_text_file(file));
}

ProgramResult train(const fs::path& capture, const fs::path& out, const std::vector<std::string>& more = {}) {
  return cnerf(concatenated(concatenated({"train", capture.string(), "-o", out.string()}, tiny_options()), more));
}

TEST(Pipeline, RunLeavesEverythingItSays) {
  const TempDir folder;
  const fs::path out = folder / "run";
  const auto arguments = concatenated({"run", tiny_capture().string(), "-o", out.string()}, tiny_options());
  const ProgramResult result = cnerf(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
  EXPECT_THAT(result.out, HasSubstr("references")) << "says whose colours were taken";

  const std::vector<std::string> files = files_below(out);
  for (const char* file :
       {"config.toml", "run.json", "stage1.snapshot", "takes/reference/take.snapshot", "takes/reference/take.json",
        "takes/reference/metrics.json", "metrics.json", "contact_sheet.png", "bakes/reference/volume.vdb",
        "bakes/reference/blender_setup.py", "bakes/reference/manifest.json"}) {
    EXPECT_THAT(files, testing::Contains(file));
  }
  for (const std::string& file : files) EXPECT_THAT(file, testing::Not(HasSubstr("partial")));
  for (const char* file : {"contact_sheet.png", "metrics.json", "volume.vdb", "blender_setup.py"}) {
    EXPECT_THAT(result.out, HasSubstr(file)) << "is printed";
  }

  const nlohmann::json metrics = json_of(out / "metrics.json");
  EXPECT_EQ(metrics.at("schema_version"), 1);
  EXPECT_EQ(metrics.at("split"), "held-out");
  EXPECT_EQ(metrics.at("take"), "reference");
  for (const char* name : {"psnr_luminance", "psnr_rgb", "ssim", "colourfulness", "colourfulness_difference",
                           "ab_error", "ab_error_grey", "bake_ab_distance"}) {
    EXPECT_TRUE(metrics.at("mean").contains(name)) << name;
  }
  EXPECT_EQ(metrics.at("views").size(), 2u) << "every 8th of 9 views";

  EXPECT_EQ(cnerf(arguments).exit_code, 64) << "a finished run is not overwritten";
  const ProgramResult again = cnerf(concatenated(arguments, {"--resume"}));
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(files_below(out), files) << "nothing is left to do";

  for (const fs::path& thing : {out, out / "stage1.snapshot", out / "bakes/reference/volume.vdb"}) {
    const ProgramResult info = cnerf({"info", thing.string()});
    EXPECT_EQ(info.exit_code, 0) << thing << info.err;
    EXPECT_GT(info.out.size(), 50u);
  }
}

TEST(Pipeline, StepsOneByOneWithoutColour) {
  const TempDir folder;
  const std::string out = (folder / "run").string();
  ASSERT_EQ(train(tiny_capture(), out).exit_code, 0);
  EXPECT_EQ(cnerf({"eval", out}).exit_code, 0);
  EXPECT_FALSE(json_of(folder / "run/metrics.json").at("mean").contains("psnr_rgb"));
  EXPECT_EQ(cnerf({"bake", out}).exit_code, 0);
  EXPECT_EQ(cnerf({"bake", out}).exit_code, 64) << "a bake is not overwritten";
  EXPECT_EQ(cnerf({"bake", out, "--overwrite", "--houdini"}).exit_code, 0);
  const ProgramResult render = cnerf({"render", out, "--path", "held-out", "--format", "png,exr"});
  EXPECT_EQ(render.exit_code, 0) << render.err;
  EXPECT_EQ(files_below(folder / "run/renders/grey/held-out").size(), 4u) << "two views, two formats";
  EXPECT_EQ(cnerf({"render", out, "--path", "orbit", "--format", "gif"}).exit_code, 64);
  EXPECT_EQ(cnerf({"eval", out, "--take", "none"}).exit_code, 66);
}

TEST(Pipeline, TakesStandSideBySide) {
  const TempDir folder;
  const std::string out = (folder / "run").string();
  ASSERT_EQ(train(tiny_capture(), out).exit_code, 0);
  const auto colorize = [&](const std::vector<std::string>& more) {
    return cnerf(concatenated({"colorize", out, "--colorizer", "grey"}, more)).exit_code;
  };
  EXPECT_EQ(colorize({}), 0);
  EXPECT_EQ(colorize({}), 0) << "a second take gets a name of its own";
  EXPECT_EQ(colorize({"--take", "mine"}), 0);
  EXPECT_EQ(colorize({"--take", "mine"}), 64);
  EXPECT_EQ(colorize({"--take", "a/b"}), 64);
  for (const char* take : {"grey", "grey-2", "mine"}) {
    EXPECT_TRUE(fs::exists(folder / "run/takes" / take / "take.json")) << take;
  }
}

TEST(Pipeline, ProgressAsJson) {
  const TempDir folder;
  const ProgramResult result = train(tiny_capture(), folder / "run", {"--progress", "json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::istringstream lines(result.out);
  double last = 0;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json json = nlohmann::json::parse(line);
    if (json.at("event") == "progress") last = json.at("fraction");
  }
  EXPECT_EQ(last, 1.0);
}

/// Interrupted and resumed, with another number of threads, gives the bytes of an uninterrupted run.
TEST(Pipeline, ResumingIsExact) {
  const TempDir folder;
  ASSERT_EQ(train(tiny_capture(), folder / "whole").exit_code, 0);
  const auto arguments =
      concatenated({"train", tiny_capture().string(), "-o", (folder / "parts").string(), "--progress", "json"},
                   concatenated(tiny_options(), {"--threads", "1"}));
  const ProgramResult stopped = cnerf_interrupted_at(arguments, "\"progress\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  EXPECT_THAT(stopped.err, HasSubstr("--resume"));
  const ProgramResult resumed = cnerf(concatenated(arguments, {"--resume"}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_TRUE(read_binary_file(folder / "parts/stage1.snapshot") == read_binary_file(folder / "whole/stage1.snapshot"));
}

TEST(Pipeline, ResumingAColorizationIsExact) {
  const TempDir folder;
  const fs::path whole = folder / "whole", parts = folder / "parts";
  ASSERT_EQ(train(tiny_capture(), whole).exit_code, 0);
  const auto colorize = [](const fs::path& run) {
    return std::vector<std::string>{"colorize",    run.string(),           "--take",     "t",
                                    "--colorizer", "reference:references", "--progress", "json"};
  };
  fs::copy(whole, parts, fs::copy_options::recursive);
  ASSERT_EQ(cnerf(colorize(whole)).exit_code, 0);
  fs::copy(whole / "cache", parts / "cache");
  const ProgramResult stopped = cnerf_interrupted_at(colorize(parts), "\"stage 2\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  EXPECT_FALSE(fs::exists(parts / "takes/t/take.json")) << "only a finished take has one";
  const ProgramResult resumed = cnerf(concatenated(colorize(parts), {"--resume"}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_TRUE(read_binary_file(parts / "takes/t/take.snapshot") == read_binary_file(whole / "takes/t/take.snapshot"));
}

/// The snapshot does not fit on the disk: named, nothing half-written, and the run goes on once there is room.
TEST(Pipeline, FullDiskLosesNothing) {
  const TempDir folder;
  const fs::path out = folder / "run";
  const auto arguments = concatenated({"train", tiny_capture().string(), "-o", out.string()}, tiny_options());
  const ProgramResult full = cnerf_with_file_limit(arguments, 40'000);
  EXPECT_EQ(full.exit_code, 73) << full.err;
  EXPECT_THAT(full.err, HasSubstr("stage1.snapshot"));
  EXPECT_THAT(files_below(out), testing::UnorderedElementsAre("config.toml", "run.json"));
  const ProgramResult resumed = cnerf(concatenated(arguments, {"--resume"}));
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
}

TEST(Pipeline, DamagedSnapshotsAreRefusedByName) {
  const TempDir folder;
  const fs::path out = folder / "run", snapshot = out / "stage1.snapshot";
  ASSERT_EQ(train(tiny_capture(), out).exit_code, 0);
  fs::resize_file(snapshot, fs::file_size(snapshot) / 2);
  const ProgramResult cut = cnerf({"eval", out.string()});
  EXPECT_EQ(cut.exit_code, 78);
  EXPECT_THAT(cut.err, HasSubstr("stage1.snapshot"));
  write_file(snapshot, std::string_view("something else"));
  EXPECT_EQ(cnerf({"bake", out.string()}).exit_code, 78);
  EXPECT_TRUE(files_below(out / "bakes").empty());
}

}  // namespace
}  // namespace cnerf::test
