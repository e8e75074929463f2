#include "src/pipeline/run_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/pipeline/bake_step.h"
#include "src/pipeline/colorize_step.h"
#include "src/pipeline/run_context.h"
#include "tests/support/data.h"

namespace cnerf::pipeline {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(RunDirectoryTest, RecordsReturnAsTheyWereSaved) {
  const test::TempDir folder;
  const RunDirectory run(folder / "run");
  EXPECT_FALSE(run.exists());
  RunRecord record;
  record.capture = "/captures/a";
  record.program_version = "0.1.0";
  record.command_line = "cnerf run \"a b\"";
  record.stage1 = {{120, 1.5, 2e9, 27.25}, true};
  record.current_take = "reference";
  run.save(record);
  const RunRecord read = RunDirectory::open(folder / "run").record();
  EXPECT_EQ(read.capture, record.capture);
  EXPECT_EQ(read.command_line, record.command_line);
  EXPECT_TRUE(read.stage1.finished);
  EXPECT_EQ(read.stage1.steps, 120);
  EXPECT_EQ(read.stage1.train_psnr, 27.25);
  EXPECT_EQ(read.current_take, "reference");

  EXPECT_FALSE(run.take_record("reference"));
  run.save(
      TakeRecord{"reference",
                 "reference:a.png",
                 {.accepted = 40, .rejected = 10, .seconds = 3.5, .waited_seconds = 0.25, .bake_ab_distance = 0.5}});
  const TakeRecord take = run.take_record("reference").value();
  EXPECT_EQ(take.colorizer, "reference:a.png");
  EXPECT_EQ(take.stage2.accepted, 40);
  EXPECT_EQ(take.stage2.waited_seconds, 0.25);
  EXPECT_EQ(take.stage2.bake_ab_distance, 0.5);
}

TEST(RunDirectoryTest, WhatIsNoRunIsSaidToBeNone) {
  const test::TempDir folder;
  EXPECT_THROW(RunDirectory::open(folder / "absent"), MissingInputError);
  EXPECT_THROW(RunDirectory::open(folder.path()), MissingInputError);
}

TEST(RunDirectoryTest, NewerOrBrokenRecordsAreRefusedByName) {
  const test::TempDir folder;
  const RunDirectory run(folder.path());
  const auto message_for = [&](const char* json) -> std::string {
    write_file(run.record_file(), std::string_view(json));
    try {
      (void)run.record();
    } catch (const SnapshotError& error) {
      return error.what();
    }
    return "(accepted)";
  };
  EXPECT_THAT(message_for("{\"schema_version\": 99}"), testing::AllOf(HasSubstr("run.json"), HasSubstr("99")));
  EXPECT_THAT(message_for("{\"schema_version\": 1"), HasSubstr("run.json"));
  EXPECT_THAT(message_for("{\"schema_version\": 1}"), HasSubstr("run.json: program_version: is missing"));
}

TEST(RunDirectoryTest, RunsFromBeforeAKeyWasRetiredAreRead) {
  const test::TempDir folder;
  const RunDirectory run(folder.path());
  write_file(run.config_file(), std::string_view("[bake]\nresolution = 99\ndilation = 2\n[vdb]\ndilation = 2\n"));
  Observer observer;
  EXPECT_EQ(run.config("", observer).bake.resolution, 99);
}

TEST(RunDirectoryTest, TakesStandSideBySide) {
  const test::TempDir folder;
  const RunDirectory run(folder.path());
  RunRecord record;
  run.save(record);
  EXPECT_EQ(run.choose_take(""), "") << "not colorized";
  EXPECT_EQ(run.free_take_name("exec"), "exec");
  run.save(TakeRecord{"exec", "exec:a", {}});
  EXPECT_EQ(run.free_take_name("exec"), "exec-2");
  record.current_take = "exec";
  run.save(record);
  EXPECT_EQ(run.choose_take(""), "exec");
  EXPECT_EQ(run.choose_take("grey"), "");
  try {
    (void)run.choose_take("other");
    FAIL() << "a take that does not exist was chosen";
  } catch (const MissingInputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("there are: exec"));
  }
  record.current_take = "gone";
  run.save(record);
  try {
    (void)run.choose_take("");
    FAIL() << "a take that does not exist was chosen";
  } catch (const MissingInputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("run.json: current_take: no finished take 'gone'"));
  }
}

TEST(RunDirectoryTest, TakeNamesAreFolderNames) {
  EXPECT_NO_THROW(check_take_name("warm-2_a.b"));
  for (const char* bad : {"", "..", ".x", "a/b", "a b", "\xc3\xa9"})
    EXPECT_THROW(check_take_name(bad), UsageError) << bad;
}

TEST(RunDirectoryTest, ABundleIsAWholeBakeUnlessItsBakeStopped) {
  const test::TempDir folder;
  const exporting::Formats formats{.gltf = true, .web = true};
  write_file(folder / "web" / "bundle.json", std::string_view("{}"));
  const auto are_there = [&] {
    return std::ranges::any_of(whole_bakes(folder.path(), formats),
                               [](const fs::path& file) { return fs::exists(file); });
  };
  EXPECT_TRUE(are_there());
  write_file(folder / "unfinished.bake", std::string_view("planes"));
  EXPECT_FALSE(are_there()) << "the same command goes on";
}

TEST(RunDirectoryTest, AStepHoldsTheRunsOwnFolderOnceHoweverItIsSpelt) {
  const test::TempDir folder;
  const RunDirectory run(folder / "run");
  run.save(RunRecord{});
  fs::create_directory_symlink(run.root(), folder / "link");
  Observer silent;
  for (const fs::path& spelt : {folder / "run/", folder / "./run", folder / "link"}) {
    EXPECT_FALSE(StepLocks(run, spelt, silent).own) << spelt;
  }
  EXPECT_TRUE(StepLocks(run, folder / "run/renders", silent).own);
  EXPECT_TRUE(StepLocks(run, folder / "elsewhere", silent).own);
}

TEST(RunDirectoryTest, GoingOnAndOverwritingAtOnceAreRefused) {
  const test::TempDir folder;
  const RunDirectory run(folder / "run");
  const RunContext context{run, {}, {}, {}};
  const ExistingOutput both{.resume = true, .overwrite = true};
  EXPECT_THROW(check_run_folder(run, both), UsageError);
  EXPECT_THROW((void)take_to_write(context, "warm", both), UsageError);
  EXPECT_EQ(take_to_write(context, "warm", {.resume = true}), "warm");
}

TEST(RunDirectoryTest, ClearingRemovesARunAndNothingElse) {
  const test::TempDir folder;
  const RunDirectory run(folder.path());
  run.save(RunRecord{});
  write_file(run.take_snapshot("a"), std::string_view("x"));
  write_file(folder / "my_notes.txt", std::string_view("x"));
  run.clear();
  EXPECT_FALSE(run.exists());
  EXPECT_FALSE(fs::exists(run.take_folder("a")));
  EXPECT_TRUE(fs::exists(folder / "my_notes.txt"));
}

}  // namespace
}  // namespace cnerf::pipeline
