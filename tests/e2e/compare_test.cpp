/// Comparisons on a tiny capture.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;

nlohmann::json json_of(const fs::path& file) {
  return nlohmann::json::parse(read_text_file(file));
}

ProgramResult compare(const fs::path& out, const std::string& methods, const std::vector<std::string>& more = {}) {
  return cnerf(concatenated(
      concatenated({"compare", tiny_capture().string(), "-o", out.string(), "--methods", methods}, tiny_options()),
      more));
}

nlohmann::json row_of(const nlohmann::json& table, const std::string& method) {
  for (const auto& row : table["tables"][0]["rows"]) {
    if (row["method"] == method) return row;
  }
  ADD_FAILURE() << "no row " << method;
  return {};
}

TEST(Compare, EveryMethodLeavesARowAndTheReportStandsAlone) {
  const TempDir folder;
  const ProgramResult result = compare(folder / "out", "all", {"--rating-sheet"});
  ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
  EXPECT_THAT(result.out, HasSubstr("simulated")) << "says who colours";
  const auto table = json_of(folder / "out/table.json");
  ASSERT_EQ(table["tables"].size(), 1u);
  for (const auto& row : table["tables"][0]["rows"]) {
    if (row["method"] == "style-transfer") continue;
    EXPECT_FALSE(row.contains("error")) << row.dump();
    EXPECT_TRUE(row.contains("psnr_rgb")) << row.dump();
  }
  EXPECT_EQ(table["tables"][0]["rows"].size(), 10u);
  EXPECT_THAT(row_of(table, "style-transfer")["error"], HasSubstr("--lpips-weights")) << "it needs a network";
  ASSERT_EQ(table["training_times"].size(), 2u);
  for (const auto& race : table["training_times"]) {
    EXPECT_GT(race["hash_grid"]["seconds"], 0) << race.dump();
    EXPECT_GT(race["mlp"]["seconds"], 0) << race.dump();
  }
  EXPECT_THAT(read_text_file(folder / "out/table.md"), HasSubstr("## Training times"));
  EXPECT_EQ(row_of(table, "grey")["colourfulness"]["mean"], 0);
  EXPECT_FALSE(row_of(table, "grey").contains("lpips")) << "no weights were given";
  const std::string report = read_text_file(folder / "out/report.html");
  EXPECT_THAT(report, HasSubstr("data:image/jpeg"));
  EXPECT_THAT(report, HasSubstr("colorize-then-fuse"));
  EXPECT_THAT(files_below(folder / "out"), Contains("rating_sheet.html"));

  // Two raters who like one method, and no other.
  const auto key = json_of(folder / "out/rating_key.json");
  for (const char* name : {"a.json", "b.json"}) {
    nlohmann::json answers = {{"sheet", key["sheet"]}, {"answers", nlohmann::json::array()}};
    for (const auto& [item, what] : key["items"].items()) {
      const int grade = what["method"] == "colornerf" ? 5 : 2;
      answers["answers"].push_back({{"item", item}, {"plausibility", grade}, {"vividness", grade}});
    }
    write_file(folder / name, answers.dump());
  }
  const ProgramResult rated = cnerf({"compare", "-o", (folder / "out").string(), "--ratings",
                                     (folder / "a.json").string(), (folder / "b.json").string()});
  ASSERT_EQ(rated.exit_code, 0) << rated.err;
  EXPECT_THAT(read_text_file(folder / "out/ratings.md"), HasSubstr("| colornerf | 5.00"));
}

TEST(Compare, StyleTransferFollowsTheReferenceItIsGiven) {
  CNERF_REQUIRE_DATA(weights, "lpips/lpips_alex_f32.bin");
  const TempDir folder;
  const std::string reference = (tiny_capture() / "references/view_001.png").string();
  const ProgramResult result =
      compare(folder / "out", "style-transfer,grey",
              {"--lpips-weights", weights.string(), "--style-reference", reference, "--set", "compare.style_steps=8"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto table = json_of(folder / "out/table.json");
  const auto row = row_of(table, "style-transfer");
  EXPECT_FALSE(row.contains("error")) << row.dump();
  EXPECT_GT(row["colourfulness"]["mean"], 1);
  EXPECT_TRUE(row.contains("lpips"));

  const ProgramResult missing = compare(folder / "other", "style-transfer",
                                        {"--lpips-weights", weights.string(), "--style-reference", "missing.png"});
  EXPECT_THAT(row_of(json_of(folder / "other/table.json"), "style-transfer")["error"], HasSubstr("missing.png"));
}

/// Parts that ran side by side in one folder make one table.
TEST(Compare, SeedsOfSeveralRunsAreJoined) {
  const TempDir folder;
  const fs::path out = folder / "out";
  ASSERT_EQ(compare(out, "colornerf", {"--first-seed", "2", "--resume"}).exit_code, 0);
  ASSERT_EQ(compare(out, "colornerf", {"--resume"}).exit_code, 0);
  const fs::path cell = out / "runs" / tiny_capture().filename() / "seed-2/colornerf/cell.json";
  const auto before = fs::last_write_time(cell);
  ASSERT_EQ(compare(out, "colornerf,grey", {"--seeds", "3", "--only-report"}).exit_code, 0);
  EXPECT_EQ(fs::last_write_time(cell), before) << "nothing is trained";
  const auto table = json_of(out / "table.json");
  EXPECT_EQ(row_of(table, "colornerf")["psnr_rgb"]["n"], 2);
  EXPECT_EQ(table["tables"][0]["rows"].size(), 1u) << "of grey there is nothing";
  EXPECT_EQ(compare(folder / "empty", "colornerf", {"--only-report"}).exit_code, 64);
}

TEST(Compare, ResumingMakesOnlyWhatIsMissing) {
  const TempDir folder;
  const fs::path out = folder / "out";
  ASSERT_EQ(compare(out, "colornerf,grey").exit_code, 0);
  EXPECT_EQ(compare(out, "colornerf,grey").exit_code, 64) << "neither --resume nor --overwrite";
  const fs::path cell = out / "runs" / tiny_capture().filename() / "seed-1/colornerf/cell.json";
  const auto before = fs::last_write_time(cell);
  const std::string content = read_text_file(cell);

  const ProgramResult more = compare(out, "colornerf,without-classification,grey", {"--resume"});
  ASSERT_EQ(more.exit_code, 0) << more.err;
  EXPECT_EQ(fs::last_write_time(cell), before);
  EXPECT_EQ(json_of(out / "table.json")["tables"][0]["rows"].size(), 3u);

  // Other settings make it anew.
  const ProgramResult changed = compare(out, "colornerf", {"--resume", "--set", "stage2.patches=7"});
  ASSERT_EQ(changed.exit_code, 0) << changed.err;
  EXPECT_NE(fs::last_write_time(cell), before);
  EXPECT_NE(read_text_file(cell), content);
}

TEST(Compare, SeedsGiveConfidenceAndTheSameSeedTheSameNumbers) {
  const TempDir folder;
  for (const char* name : {"a", "b"}) {
    ASSERT_EQ(compare(folder / name, "colornerf", {"--seeds", "2"}).exit_code, 0);
  }
  const auto a = json_of(folder / "a/table.json"), b = json_of(folder / "b/table.json");
  EXPECT_EQ(row_of(a, "colornerf")["psnr_rgb"]["n"], 2);
  EXPECT_GT(row_of(a, "colornerf")["psnr_rgb"]["ci95"], 0);
  EXPECT_EQ(row_of(a, "colornerf")["psnr_rgb"], row_of(b, "colornerf")["psnr_rgb"]);
}

TEST(Compare, AMethodThatFailsLeavesARowThatSaysSo) {
  const TempDir folder;
  const ProgramResult result = compare(folder / "out", "colornerf,grey", {"--colorizer", "exec:false"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto table = json_of(folder / "out/table.json");
  EXPECT_THAT(row_of(table, "colornerf")["error"], HasSubstr("exec:false"));
  EXPECT_TRUE(row_of(table, "grey").contains("psnr_rgb"));
}

TEST(Compare, ACaptureMayHaveASizeOfItsOwn) {
  const TempDir folder;
  const std::string small = tiny_capture().string() + "@2";
  const ProgramResult result = cnerf(
      concatenated({"compare", tiny_capture().string(), small, "-o", (folder / "out").string(), "--methods", "grey"},
                   tiny_options()));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out + result.err, HasSubstr("24 x 18"));
  EXPECT_EQ(json_of(folder / "out/table.json")["tables"].size(), 3u) << "two captures and both together";
  EXPECT_EQ(cnerf({"compare", tiny_capture().string() + "@0", "-o", (folder / "no").string()}).exit_code, 64);
}

TEST(Compare, WhatCannotBeComparedIsRefusedBeforeTraining) {
  const TempDir folder;
  EXPECT_EQ(compare(folder / "out", "colornef").exit_code, 64);
  EXPECT_EQ(compare(folder / "out", "grey", {"--colorizer", "simulated:hues=3"}).exit_code, 64);
  EXPECT_EQ(compare(folder / "out", "grey", {"--lpips-weights", "missing.bin"}).exit_code, 66);
  EXPECT_EQ(cnerf({"compare", "-o", (folder / "out").string()}).exit_code, 64);
  EXPECT_FALSE(fs::exists(folder / "out"));

  fs::copy(tiny_capture(), folder / "grey", fs::copy_options::recursive);
  fs::remove_all(folder / "grey/color");
  const ProgramResult grey = cnerf({"compare", (folder / "grey").string(), "-o", (folder / "out").string()});
  EXPECT_EQ(grey.exit_code, 65);
  EXPECT_THAT(grey.err, HasSubstr("grey"));

  fs::create_directory(folder / "full");
  write_file(folder / "full/mine.txt", std::string("mine"));
  EXPECT_EQ(compare(folder / "full", "grey", {"--overwrite"}).exit_code, 64);
  EXPECT_TRUE(fs::exists(folder / "full/mine.txt"));
  EXPECT_EQ(cnerf({"colorize", "x", "--colorizer", "simulated:"}).exit_code, 66);  // no such run
}

}  // namespace
}  // namespace cnerf::test
