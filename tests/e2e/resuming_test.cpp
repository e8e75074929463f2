/// Runs that are stopped, run out of disk or are damaged.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"
#include "tests/support/sanitizers.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

/// Interrupted and resumed, with another number of threads, gives the bytes of an uninterrupted run.
TEST(Resuming, TrainingIsExact) {
  const TempDir folder;
  const auto arguments =
      concatenated({"train", tiny_capture().string(), "-o", (folder / "parts").string(), "--progress", "json"},
                   concatenated(tiny_options(), {"--threads", "1"}));
  const ProgramResult stopped = cnerf_interrupted_at(arguments, "\"progress\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  EXPECT_THAT(stopped.err, HasSubstr("--resume"));
  const std::string config = read_text_file(folder / "parts/config.toml");
  const ProgramResult other = cnerf(concatenated(arguments, {"--resume", "--set", "stage1.seed=99"}));
  EXPECT_NE(other.exit_code, 0);
  EXPECT_THAT(other.err, HasSubstr("other stage1 options"));
  EXPECT_EQ(read_text_file(folder / "parts/config.toml"), config) << "a refused continuation changes nothing";
  const ProgramResult resumed = cnerf(concatenated(arguments, {"--resume"}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_TRUE(read_binary_file(folder / "parts/stage1.snapshot") == read_binary_file(tiny_run() / "stage1.snapshot"));
}

TEST(Resuming, ATrainingThatAdjustsCamerasIsExact) {
  const TempDir folder;
  const std::string capture = (folder / "capture").string();
  ASSERT_EQ(cnerf({"sample", "-o", capture, "--cloth", "--path", "orbit", "--views", "24", "--width", "240", "--height",
                   "180", "--samples-per-pixel", "4"})
                .exit_code,
            0);
  auto cameras = nlohmann::json::parse(read_text_file(folder / "capture/transforms.json"));
  for (std::size_t i = 0; i < cameras["frames"].size(); i += 2) {
    auto& height = cameras["frames"][i]["transform_matrix"][2][3];
    height = 0.03 + height.get<double>();
  }
  write_file(folder / "capture/transforms.json", std::string_view(cameras.dump()));
  const auto training = [&](const std::string& run) {
    return concatenated({"train", capture, "-o", (folder / run).string(), "--progress", "json", "--set",
                         "stage1.poses=true", "--set", "stage1.lenses=true"},
                        tiny_options());
  };
  const ProgramResult whole = cnerf(training("whole"));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_THAT(whole.out + whole.err, HasSubstr("cameras adjusted"));
  const ProgramResult stopped = cnerf_interrupted_at(training("parts"), "\"stage 1\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  const ProgramResult resumed = cnerf(concatenated(training("parts"), {"--resume"}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_TRUE(read_binary_file(folder / "parts/stage1.snapshot") == read_binary_file(folder / "whole/stage1.snapshot"));
  EXPECT_THAT(cnerf({"info", (folder / "whole").string()}).out,
              testing::AllOf(HasSubstr("cameras:"), HasSubstr("lens:"), HasSubstr("focal length times")));
}

TEST(Resuming, AColorizationIsExact) {
  const TempDir folder;
  const fs::path whole = copied(tiny_run(), folder / "whole"), parts = copied(tiny_run(), folder / "parts");
  const auto colorize = [](const fs::path& run) {  // enough steps to be stopped between
    return std::vector<std::string>{"colorize",    run.string(),
                                    "--take",      "t",
                                    "--colorizer", "reference:references",
                                    "--progress",  "json",
                                    "--set",       "colorizer.reference_steps=20",
                                    "--set",       "stage2.distill_steps=10"};
  };
  ASSERT_EQ(cnerf(colorize(whole)).exit_code, 0);
  fs::copy(whole / "cache", parts / "cache");
  const ProgramResult stopped = cnerf_interrupted_at(colorize(parts), "\"stage 2\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  EXPECT_FALSE(fs::exists(parts / "takes/t/take.json")) << "only a finished take has one";
  const std::string config = read_text_file(parts / "takes/t/config.toml");
  const ProgramResult refused = cnerf(concatenated(colorize(parts), {"--resume", "--set", "stage2.patches=999"}));
  EXPECT_EQ(refused.exit_code, 78) << refused.err;
  EXPECT_EQ(read_text_file(parts / "takes/t/config.toml"), config) << "what is refused changes nothing";
  // The take that was begun, with its own colorizer and not the run's.
  const ProgramResult resumed = cnerf({"colorize", parts.string(), "--resume"});
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_TRUE(read_binary_file(parts / "takes/t/take.snapshot") == read_binary_file(whole / "takes/t/take.snapshot"));
}

TEST(Resuming, KeyFramesInsteadOfTheRunsColorizerGoOnByTheSameCommand) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run");
  std::string config = read_text_file(run / "config.toml");
  const std::string none = "spec = ''";
  ASSERT_NE(config.find(none), std::string::npos);
  write_file(run / "config.toml", config.replace(config.find(none), none.size(), "spec = 'builtin'"));
  const std::vector<std::string> colorize = {
      "colorize",   run.string(),
      "--keyframe", "view_004=" + (tiny_capture() / "color/view_004.png").string(),
      "--set",      "colorizer.reference_steps=10",
      "--set",      "colorizer.reference_on_builtin=false",
      "--set",      "stage2.patches=400",
      "--progress", "json"};
  const ProgramResult stopped = cnerf_interrupted_at(colorize, "\"stage 2\"");
  if (stopped.exit_code == 0) GTEST_SKIP() << "the program was done before the signal arrived";
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  const ProgramResult resumed = cnerf(concatenated(colorize, {"--resume"}));
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_TRUE(fs::exists(run / "takes/reference/take.json"));
}

/// Arguments of a whole run by the capture's own references.
std::vector<std::string> run_by_references(const fs::path& run) {
  return concatenated({"run", tiny_capture().string(), "-o", run.string(), "--colorizer", "reference:references"},
                      concatenated(tiny_options(), {"--set", "render.frames=2"}));
}

/// Such a run, finished, at `to`: a copy of one that a process makes once.
fs::path finished_run(const fs::path& to) {
  static const TempDir folder;
  static const ProgramResult made = cnerf(run_by_references(folder / "run"));
  EXPECT_EQ(made.exit_code, 0) << made.err;
  return copied(folder / "run", to);
}

TEST(Resuming, ARunLeavesTakesAloneThatOtherCommandsBegan) {
  const TempDir folder;
  const fs::path run = finished_run(folder / "run");
  const auto arguments = run_by_references(run);
  write_file(run / "takes/zz/config.toml", read_text_file(run / "config.toml"));
  fs::remove(run / "takes/reference/take.json");  // as if it had been stopped
  auto record = nlohmann::json::parse(read_text_file(run / "run.json"));
  record["current_take"] = "";
  write_file(run / "run.json", std::string_view(record.dump()));
  const ProgramResult resumed = cnerf(concatenated(arguments, {"--resume"}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_THAT(files_below(run / "takes/zz"), testing::ElementsAre("config.toml"));
  EXPECT_EQ(nlohmann::json::parse(read_text_file(run / "run.json"))["current_take"], "reference");
}

TEST(Resuming, OtherOptionsForAFinishedStepAreToldAndNotWrittenDown) {
  const TempDir folder;
  const fs::path run = finished_run(folder / "run");
  const auto arguments = run_by_references(run);
  const auto resumed_with = [&](const std::vector<std::string>& settings) {
    std::vector<std::string> all = concatenated(arguments, {"--resume"});
    for (const std::string& setting : settings) all = concatenated(all, {"--set", setting});
    return cnerf(all);
  };
  const std::string config = read_text_file(run / "config.toml");
  const ProgramResult resumed =
      resumed_with({"stage2.patches=7", "colorizer.reference_steps=21", "bake.resolution=24", "render.frames=3"});
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  const std::string said = resumed.out + resumed.err;
  for (const std::string told :
       {"take reference is there and stays; stage2.patches is for: cnerf colorize", "colorizer.reference_steps is for",
        "the bake is there and stays; bake.resolution is for: cnerf bake",
        "the video is there and stays; render.frames is for: cnerf render"}) {
    EXPECT_THAT(said, HasSubstr(told));
  }
  EXPECT_EQ(read_text_file(run / "config.toml"), config) << "of what the run was made with";
  EXPECT_THAT(resumed_with({}).out, testing::Not(HasSubstr("stays;")));

  fs::remove_all(run / "bakes");
  ASSERT_EQ(resumed_with({"bake.resolution=24"}).exit_code, 0);
  EXPECT_THAT(read_text_file(run / "config.toml"), HasSubstr("resolution = 24")) << "what is not there is made so";
}

TEST(Resuming, OnOtherViewsIsRefusedAndChangesNothing) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run");
  const std::string before = read_text_file(run / "config.toml");
  const auto again = concatenated({"train", tiny_capture().string(), "-o", run.string(), "--resume"}, tiny_options());
  EXPECT_EQ(cnerf(again).exit_code, 0);
  const ProgramResult refused = cnerf(concatenated(again, {"--holdout", "2"}));
  EXPECT_EQ(refused.exit_code, 78) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("capture.holdout"));
  // Of a finished run too: its configuration says what it was made with.
  const ProgramResult another_seed = cnerf(concatenated(again, {"--set", "stage1.seed=99"}));
  EXPECT_EQ(another_seed.exit_code, 78) << another_seed.err;
  EXPECT_EQ(read_text_file(run / "config.toml"), before);
}

TEST(Resuming, ACaptureThatWasMovedIsAskedFor) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run");
  std::string record = read_text_file(run / "run.json");
  const std::string capture = tiny_capture().string();
  record.replace(record.rfind(capture), capture.size(), "/absent/capture");
  write_file(run / "run.json", record);
  const ProgramResult moved = cnerf({"eval", run.string()});
  EXPECT_EQ(moved.exit_code, 66);
  EXPECT_THAT(moved.err,
              testing::AllOf(HasSubstr("run.json: capture"), HasSubstr("/absent/capture"), HasSubstr("--capture")));
  EXPECT_EQ(cnerf({"eval", run.string(), "--capture", capture}).exit_code, 0);
}

TEST(Resuming, OtherCamerasAreRefusedAndChangeNothing) {
  const TempDir folder;
  const fs::path run = copied(tiny_run(), folder / "run"), capture = copied(tiny_capture(), folder / "capture");
  const std::vector<std::string> eval = {"eval", run.string(), "--capture", capture.string()};
  // The training views stay the same, their cameras too.
  for (const char* same : {"capture.downscale=2", "capture.holdout=8", "capture.holdout=0"}) {
    const ProgramResult taken = cnerf(concatenated(eval, {"--set", same}));
    ASSERT_EQ(taken.exit_code, 0) << same << ": " << taken.err;
  }
  const std::string config = read_text_file(run / "config.toml"), metrics = read_text_file(run / "metrics.json");
  const auto is_refused = [&](const std::vector<std::string>& words, const std::string& why) {
    const ProgramResult refused = cnerf(words);
    EXPECT_EQ(refused.exit_code, 78) << why << ": " << refused.err;
    EXPECT_THAT(refused.err, testing::AllOf(HasSubstr("stage1.snapshot"), HasSubstr("cameras"), HasSubstr(why)));
    EXPECT_EQ(read_text_file(run / "config.toml"), config) << why;
    EXPECT_EQ(read_text_file(run / "metrics.json"), metrics) << why;
  };
  for (const char* others : {"capture.holdout=2", "capture.holdout=3"}) {
    is_refused(concatenated(eval, {"--set", others}), "capture.holdout");
  }
  auto poses = nlohmann::json::parse(read_text_file(capture / "transforms.json"));
  for (auto& frame : poses["frames"]) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto& at = frame["transform_matrix"][axis][3];
      at = 2 * at.get<double>();
    }
  }
  write_file(capture / "transforms.json", std::string_view(poses.dump()));
  is_refused(eval, "poses");
  is_refused(concatenated({"train", capture.string(), "-o", run.string(), "--resume"}, tiny_options()), "poses");
}

TEST(Resuming, AShortageOfMemoryIsNoCrash) {
  if (kIsSanitized) GTEST_SKIP() << "sanitizers take more before they begin, and end a process that has none";
  const TempDir folder;
  const auto arguments = concatenated(
      {"train", tiny_capture().string(), "-o", (folder / "run").string(), "--max-memory", "300M"}, tiny_options());
  const ProgramResult small = cnerf(arguments);
  EXPECT_EQ(small.exit_code, 0) << small.err;
  const ProgramResult large =
      cnerf(concatenated(arguments, {"--overwrite", "--set", "stage1.grid.log2_rows=23", "--set",
                                     "stage1.grid.levels=16", "--set", "stage1.grid.finest_resolution=2048"}));
  EXPECT_EQ(large.exit_code, 71) << large.err;
  EXPECT_THAT(large.err, HasSubstr("out of memory"));
  EXPECT_THAT(files_below(folder / "run"), testing::Each(testing::Not(HasSubstr("partial"))));
}

/// The snapshot does not fit on the disk: named, nothing half-written, and the run goes on once there is room.
TEST(Resuming, FullDiskLosesNothing) {
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

TEST(Resuming, DamagedSnapshotsAreRefusedByName) {
  const TempDir folder;
  const fs::path out = copied(tiny_run(), folder / "run"), snapshot = out / "stage1.snapshot";
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
