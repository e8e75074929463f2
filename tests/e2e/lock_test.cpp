/// Two programs in one folder.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/base/files.h"
#include "src/base/folder_lock.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kBusy = 75;

void expect_busy(const std::vector<std::string>& arguments) {
  const ProgramResult result = cnerf(arguments);
  EXPECT_EQ(result.exit_code, kBusy) << arguments.front() << ": " << result.out << result.err;
  EXPECT_THAT(result.err, HasSubstr("another cnerf (pid " + std::to_string(::getpid()))) << arguments.front();
}

TEST(Busy, NobodyWritesIntoARunThatIsWrittenTo) {
  const TempDir folder;
  const fs::path run = copied(tiny_take(), folder / "run");
  const std::string capture = tiny_capture().string();
  {
    const FolderLock lock(run);
    expect_busy(concatenated({"train", capture, "-o", run.string(), "--overwrite"}, tiny_options()));
    expect_busy({"train", capture, "-o", run.string(), "--resume"});
    expect_busy(concatenated({"run", capture, "-o", run.string(), "--grey", "--overwrite"}, tiny_options()));
    expect_busy({"colorize", run.string(), "--take", "other", "--colorizer", "grey"});
    expect_busy({"bake", run.string(), "-o", (folder / "bake").string()});
    expect_busy({"eval", run.string()});
    expect_busy({"render", run.string(), "--path", "held-out"});
    EXPECT_EQ(cnerf({"info", run.string()}).exit_code, 0) << "who reads is not locked out";
  }
  EXPECT_TRUE(fs::exists(run / "stage1.snapshot")) << "nothing was cleared";
  EXPECT_FALSE(fs::exists(folder / "bake"));
  EXPECT_EQ(files_below(run), files_below(tiny_take()));
}

TEST(Busy, StepsOfARunWorkSideBySideButNotOnTheSame) {
  const TempDir folder;
  const fs::path run = copied(tiny_take(), folder / "run");
  const FolderLock working(run, FolderLock::Mode::kShared), take(run / "takes" / "mine"), bake(run / "bakes" / "grey");
  expect_busy({"train", tiny_capture().string(), "-o", run.string(), "--overwrite"});
  expect_busy({"colorize", run.string(), "--take", "mine", "--colorizer", "grey"});
  expect_busy({"bake", run.string()});
  const ProgramResult other = cnerf({"colorize", run.string(), "--take", "other", "--colorizer", "grey"});
  EXPECT_EQ(other.exit_code, 0) << other.err;
}

TEST(Busy, NobodyMakesACaptureOrAComparisonWhereOneIsMade) {
  const TempDir folder;
  const FolderLock capture(folder / "capture"), report(folder / "report");
  expect_busy({"sample", "-o", (folder / "capture").string()});
  expect_busy({"prepare", tiny_capture().string() + "/images", "-o", (folder / "capture").string()});
#if CNERF_COMPARE
  expect_busy({"compare", tiny_capture().string(), "-o", (folder / "report").string()});
#endif
}

TEST(Busy, WhatAKilledWriterLeftGoesWithTheNextStep) {
  const TempDir folder;
  const fs::path run = copied(tiny_take(), folder / "run");
  for (const char* left : {".stage1.partial-4194304.snapshot", "takes/other/.take.partial-4194304.snapshot"}) {
    write_file(run / left, std::string_view("half"));
  }
  const ProgramResult result = cnerf({"colorize", run.string(), "--take", "other", "--colorizer", "grey"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  for (const std::string& file : files_below(run)) EXPECT_THAT(file, testing::Not(HasSubstr(".partial-")));
}

/// A run's folder may come from anybody.
TEST(Trust, TheColorizerOfARunIsNotRunUnasked) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run"), proof = folder / "ran";
  const std::string spec = "exec:touch " + proof.string();
  std::string config = read_text_file(run / "config.toml");
  const std::string none = "spec = ''";
  ASSERT_NE(config.find(none), std::string::npos);
  config.replace(config.find(none), none.size(), "spec = '" + spec + "'");
  write_file(run / "config.toml", config);

  const ProgramResult unasked = cnerf({"colorize", run.string()});
  EXPECT_EQ(unasked.exit_code, 64) << unasked.err;
  EXPECT_THAT(unasked.err, testing::AllOf(HasSubstr(spec), HasSubstr("--trust")));
  EXPECT_FALSE(fs::exists(proof));
  EXPECT_EQ(cnerf({"colorize", run.string(), "--colorizer", spec}).exit_code, 76) << "it answers nothing";
  EXPECT_TRUE(fs::exists(proof)) << "the user named it";
  fs::remove(proof);
  EXPECT_EQ(cnerf({"colorize", run.string(), "--trust", "--overwrite"}).exit_code, 76);
  EXPECT_TRUE(fs::exists(proof));
}

TEST(Busy, ABakeIsShownAndRenderedByOneWriterAtATime) {
  const TempDir folder;
  const fs::path bake = copied(tiny_bake(), folder / "bake");
  const FolderLock lock(bake), renders(bake / "renders");
  expect_busy({"view", bake.string(), "--no-browser"});
  expect_busy({"render", bake.string()});
  EXPECT_EQ(cnerf({"info", (bake / "volume.vdb").string()}).exit_code, 0);
}

}  // namespace
}  // namespace cnerf::test
