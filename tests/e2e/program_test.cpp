/// The program as such: help, version, commands, the sample capture.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

TEST(Program, SaysItsVersion) {
  const ProgramResult result = cnerf({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, testing::ContainsRegex("^cnerf [0-9]+\\.[0-9]+\\.[0-9]+"));
}

TEST(Program, EveryCommandHasHelp) {
  const ProgramResult all = cnerf({"--help"});
  EXPECT_EQ(all.exit_code, 0);
  for (const char* command :
       {"run", "sample", "train", "colorize", "render", "eval", "compare", "bake", "view", "info", "doctor"}) {
    EXPECT_THAT(all.out, HasSubstr(command));
    const ProgramResult one = cnerf({command, "--help"});
    EXPECT_EQ(one.exit_code, 0) << command;
    EXPECT_THAT(one.out, HasSubstr("--help")) << command;
  }
}

TEST(Program, DoctorNamesLibrariesAndPrograms) {
  const ProgramResult result = cnerf({"doctor"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  for (const char* word : {"LibTorch", "BLAS", "OpenVDB", "OpenCV", "OpenEXR", "CUDA", "blender", "disk", "presets"}) {
    EXPECT_THAT(result.out, HasSubstr(word));
  }
  EXPECT_THAT(result.out, HasSubstr("quick")) << "presets are found from the build tree";
}

TEST(Program, WordsThatSayNothingAreRefused) {
  const TempDir folder;
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"sample", "-o", ""},
                                             {"train", tiny_capture().string(), "-o", ""},
                                             {"train", "", "-o", (folder / "x").string()}}) {
    const ProgramResult result = cnerf(words);
    EXPECT_EQ(result.exit_code, 64) << result.err;
    EXPECT_THAT(result.err, HasSubstr("expected a value, found nothing"));
  }
  const ProgramResult other = cnerf({"sample", "-o", (folder / "gr\xFCn").string()});
  EXPECT_EQ(other.exit_code, 64);
  EXPECT_THAT(other.err, HasSubstr("UTF-8"));
  EXPECT_THAT(files_below(folder.path()), testing::IsEmpty());
}

TEST(Program, AWorkingFolderWhoseNameIsNotUtf8IsRefused) {
  const TempDir folder;
  const fs::path before = fs::current_path(), named = folder / "caf\xE9";
  fs::create_directory(named);
  fs::current_path(named);
  const ProgramResult refused = cnerf({"sample", "-o", "capture"}), help = cnerf({"--help"});
  fs::current_path(before);
  EXPECT_EQ(refused.exit_code, 64);
  EXPECT_THAT(refused.err, HasSubstr("working folder whose name is in UTF-8"));
  EXPECT_THAT(files_below(named), testing::IsEmpty());
  EXPECT_EQ(help.exit_code, 0) << help.err;
}

TEST(Program, InfoDescribesACapture) {
  const ProgramResult result = cnerf({"info", tiny_capture().string()});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("transforms"), HasSubstr("48 x 36"), HasSubstr("9 of 9")));
  EXPECT_EQ(cnerf({"info", tiny_capture().string(), "--max-memory", "much"}).exit_code, 64) << "options count";
}

TEST(Program, SampleRefusesToOverwrite) {
  const auto before = files_below(tiny_capture());
  EXPECT_EQ(cnerf({"sample", "-o", tiny_capture().string()}).exit_code, 64);
  EXPECT_EQ(files_below(tiny_capture()), before);
}

TEST(Program, WithoutOutItWritesBesideTheCaptureAndNeverOver) {
  const TempDir folder;
  const fs::path photos = copied(tiny_capture(), folder / "photos");
  const std::vector<std::string> words =
      concatenated({"train", photos.string(), "--progress", "plain"}, tiny_options());
  const ProgramResult first = cnerf(words);
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const fs::path run = folder / "photos-run";
  EXPECT_THAT(first.out, testing::StartsWith("no -o given: writing to " + run.string() + "\n"));
  EXPECT_TRUE(fs::exists(run / "stage1.snapshot"));
  const auto before = files_below(run);
  const ProgramResult second = cnerf(words);
  EXPECT_EQ(second.exit_code, 64) << second.out;
  EXPECT_THAT(second.err, AllOf(HasSubstr(run.string()), testing::Not(HasSubstr("\x1b"))));
  EXPECT_EQ(files_below(run), before);
}

TEST(Program, QuietPrintsResultsOnly) {
  const TempDir folder;
  const ProgramResult result = cnerf({"sample", "-o", (folder / "c").string(), "--views", "2", "--width", "16",
                                      "--height", "16", "--samples-per-pixel", "1", "--quiet"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, testing::MatchesRegex("capture: +[^\n]+/c\n"));
}

TEST(Program, JsonProgressIsOneObjectALine) {
  const TempDir folder;
  const ProgramResult result = cnerf({"sample", "-o", (folder / "c").string(), "--views", "2", "--width", "16",
                                      "--height", "16", "--samples-per-pixel", "1", "--progress", "json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::istringstream lines(result.out);
  std::vector<std::string> events;
  for (std::string line; std::getline(lines, line);) events.push_back(nlohmann::json::parse(line).at("event"));
  EXPECT_THAT(events, testing::IsSupersetOf({"wrote", "next"}));
}

}  // namespace
}  // namespace cnerf::test
