/// Comparisons on a tiny capture.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "src/base/files.h"
#include "tests/e2e/program.h"
#include "tests/support/data.h"
#include "tests/support/json_file.h"

namespace cnerf::test {
namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;

ProgramResult compare(const fs::path& out, const std::string& methods, const std::vector<std::string>& more = {}) {
  // The positional encoding's MLP is asked at every step along a ray, so that steps are what it takes its time for.
  return cnerf(concatenated(concatenated({"compare", tiny_capture().string(), "-o", out.string(), "--methods", methods},
                                         tiny_options({"stage1.steps_per_box=16"})),
                            more));
}

nlohmann::json row_of(const nlohmann::json& table, const std::string& method) {
  for (const auto& row : table["tables"][0]["rows"]) {
    if (row["method"] == method) return row;
  }
  ADD_FAILURE() << "no row " << method;
  return {};
}

/// What a page's script shows.
nlohmann::json data_of(const fs::path& page) {
  const std::string html = read_text_file(page), opening = "<script type=\"application/json\" id=\"data\">";
  const std::size_t begin = html.find(opening) + opening.size();
  return nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin));
}

/// A comparison of every method, which the cases begin with.
class Compare : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TempDir>();
    made_ = compare(*shared_ / "out", "all", {"--rating-sheet"});
  }
  static void TearDownTestSuite() { shared_.reset(); }

  /// A copy of it that holds these methods alone.
  fs::path comparison_of(const std::vector<std::string>& methods) const {
    fs::path out = copied(*shared_ / "out", folder_ / "out");
    const fs::path runs = out / "runs" / tiny_capture().filename() / "seed-1";
    for (const fs::path& run : fs::directory_iterator(runs)) {
      if (fs::exists(run / "cell.json") && std::ranges::find(methods, run.filename().string()) == methods.end()) {
        fs::remove_all(run);
      }
    }
    return out;
  }

  inline static std::unique_ptr<TempDir> shared_;
  inline static ProgramResult made_;
  const TempDir folder_;
};

TEST_F(Compare, EveryMethodLeavesARowAndTheReportStandsAlone) {
  ASSERT_EQ(made_.exit_code, 0) << made_.err << made_.out;
  EXPECT_THAT(made_.out, HasSubstr("simulated")) << "says who colours";
  const fs::path out = copied(*shared_ / "out", folder_ / "out");
  const auto table = json_of(out / "table.json");
  ASSERT_EQ(table["tables"].size(), 1u);
  for (const auto& row : table["tables"][0]["rows"]) {
    if (row["method"] == "style-transfer") continue;
    EXPECT_FALSE(row.contains("error")) << row.dump();
    EXPECT_TRUE(row.contains("psnr_rgb")) << row.dump();
  }
  EXPECT_EQ(table["tables"][0]["rows"].size(), 12u);
  EXPECT_THAT(row_of(table, "style-transfer")["error"], HasSubstr("--lpips-weights")) << "it needs a network";
  ASSERT_EQ(table["training_times"].size(), 2u);
  for (const auto& race : table["training_times"]) {
    EXPECT_GT(race["hash_grid"]["seconds"], 0) << race.dump();
    EXPECT_GT(race["mlp"]["seconds"], 0) << race.dump();
  }
  EXPECT_THAT(read_text_file(out / "table.md"), HasSubstr("| positional-encoding |"));
  EXPECT_EQ(row_of(table, "grey")["colourfulness"]["mean"], 0);
  EXPECT_FALSE(row_of(table, "grey").contains("lpips")) << "no weights were given";
  const std::string report = read_text_file(out / "report.html");
  EXPECT_THAT(report, HasSubstr("data:image/jpeg"));
  EXPECT_THAT(report, HasSubstr("colorize-then-fuse"));
  EXPECT_THAT(files_below(out), Contains("rating_sheet.html"));

  // Two raters who like one method, and no other.
  const auto key = json_of(out / "rating_key.json");
  for (const char* name : {"a.json", "b.json"}) {
    nlohmann::json answers = {{"sheet", key["sheet"]}, {"answers", nlohmann::json::array()}};
    for (const auto& [item, what] : key["items"].items()) {
      const int grade = what["method"] == "colornerf" ? 5 : 2;
      answers["answers"].push_back({{"item", item}, {"plausibility", grade}, {"vividness", grade}});
    }
    write_file(folder_ / name, answers.dump());
  }
  const ProgramResult rated =
      cnerf({"compare", "-o", out.string(), "--ratings", (folder_ / "a.json").string(), (folder_ / "b.json").string()});
  ASSERT_EQ(rated.exit_code, 0) << rated.err;
  EXPECT_THAT(read_text_file(out / "ratings.md"), HasSubstr("| colornerf | 5.00"));
}

TEST_F(Compare, StyleTransferFollowsTheReferenceItIsGiven) {
  CNERF_REQUIRE_DATA(weights, "lpips/lpips_alex_f32.bin");
  const std::string reference = (tiny_capture() / "references/view_001.png").string();
  const ProgramResult result = compare(folder_ / "out", "style-transfer,grey",
                                       {"--lpips-weights", weights.string(), "--style-reference", reference});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto table = json_of(folder_ / "out/table.json");
  const auto row = row_of(table, "style-transfer");
  EXPECT_FALSE(row.contains("error")) << row.dump();
  EXPECT_GT(row["colourfulness"]["mean"], 1);
  EXPECT_TRUE(row.contains("lpips"));

  const ProgramResult missing = compare(folder_ / "other", "style-transfer",
                                        {"--lpips-weights", weights.string(), "--style-reference", "missing.png"});
  EXPECT_THAT(row_of(json_of(folder_ / "other/table.json"), "style-transfer")["error"], HasSubstr("missing.png"));
}

/// Parts that ran side by side in one folder make one table.
TEST_F(Compare, SeedsOfSeveralRunsAreJoined) {
  const fs::path out = comparison_of({"colornerf"});  // seed 1
  ASSERT_EQ(compare(out, "colornerf", {"--first-seed", "2", "--resume"}).exit_code, 0);
  const fs::path cell = out / "runs" / tiny_capture().filename() / "seed-2/colornerf/cell.json";
  const auto before = fs::last_write_time(cell);
  ASSERT_EQ(compare(out, "colornerf,grey", {"--seeds", "3", "--only-report"}).exit_code, 0);
  EXPECT_EQ(fs::last_write_time(cell), before) << "nothing is trained";
  const auto table = json_of(out / "table.json");
  EXPECT_EQ(row_of(table, "colornerf")["psnr_rgb"]["n"], 2);
  EXPECT_EQ(table["tables"][0]["rows"].size(), 1u) << "of grey there is nothing";
  EXPECT_EQ(compare(folder_ / "empty", "colornerf", {"--only-report"}).exit_code, 64);
}

// A page that looked for its table would show nothing at all.
TEST_F(Compare, ACaptureWithoutAnyCellIsLeftOutOfTheReport) {
  const fs::path out = comparison_of({"grey"});
  const std::string other = tiny_capture().string() + "@2";
  const ProgramResult result = cnerf(concatenated(
      {"compare", tiny_capture().string(), other, "-o", out.string(), "--methods", "grey", "--only-report"},
      tiny_options()));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto data = data_of(out / "report.html");
  ASSERT_EQ(data["captures"].size(), 1u);
  EXPECT_EQ(data["captures"][0]["name"], tiny_capture().filename().string());
  EXPECT_EQ(data["table"]["tables"][0]["capture"], data["captures"][0]["name"]);
}

TEST_F(Compare, ResumingMakesOnlyWhatIsMissing) {
  const fs::path out = comparison_of({"colornerf", "grey"});
  EXPECT_EQ(compare(out, "colornerf,grey").exit_code, 64) << "neither --resume nor --overwrite";
  EXPECT_EQ(compare(out, "colornerf,grey", {"--resume", "--overwrite"}).exit_code, 64) << "both";
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

TEST_F(Compare, ACaptureOfOtherViewsIsTrainedAnew) {
  const fs::path capture = copied(tiny_capture(), folder_ / "capture"), out = folder_ / "out";
  const std::vector<std::string> resume = {"compare",   capture.string(), "-o",      out.string(),
                                           "--methods", "grey",           "--resume"};
  ASSERT_EQ(cnerf(concatenated(resume, tiny_options())).exit_code, 0);
  const fs::path stage1 = out / "runs/capture/seed-1/stage1.snapshot", cell = stage1.parent_path() / "grey/cell.json";
  for (const char* list : {"train_filenames", "test_filenames"}) {
    const auto trained = fs::last_write_time(stage1), judged = fs::last_write_time(cell);
    auto poses = json_of(capture / "transforms.json");
    poses[list].erase(poses[list].size() - 1);
    write_file(capture / "transforms.json", poses.dump());
    const ProgramResult result = cnerf(concatenated(resume, tiny_options()));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(fs::last_write_time(stage1), trained) << list;
    EXPECT_NE(fs::last_write_time(cell), judged) << list;
  }
}

// A file of the same name may hold another picture by now.
TEST_F(Compare, AFileOfAnotherContentMakesItsCellsAnew) {
  const fs::path out = comparison_of({}), picture = folder_ / "picture.png";
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases = {
      {"style-transfer", {"--resume", "--style-reference", picture.string()}},
      {"grey", {"--resume", "--colorizer", "reference:" + picture.string()}}};  // concerns all cells; grey is quickest
  for (const auto& [method, options] : cases) {
    std::set<std::string> settings;
    for (const char* content : {"one", "other"}) {
      write_file(picture, std::string(content));
      const ProgramResult result = compare(out, method, options);
      ASSERT_EQ(result.exit_code, 0) << result.err;
      settings.insert(read_text_file(out / "runs" / tiny_capture().filename() / "seed-1" / method / "settings.txt"));
    }
    EXPECT_EQ(settings.size(), 2u) << method;
  }
}

TEST_F(Compare, SeedsGiveConfidenceAndTheSameSeedTheSameNumbers) {
  const fs::path out = comparison_of({"colornerf"});  // seed 1
  ASSERT_EQ(compare(folder_ / "a", "colornerf", {"--seeds", "2"}).exit_code, 0);
  ASSERT_EQ(compare(out, "colornerf", {"--seeds", "2", "--resume"}).exit_code, 0);
  const auto a = json_of(folder_ / "a/table.json"), b = json_of(out / "table.json");
  EXPECT_EQ(row_of(a, "colornerf")["psnr_rgb"]["n"], 2);
  EXPECT_GT(row_of(a, "colornerf")["psnr_rgb"]["ci95"], 0);
  EXPECT_EQ(row_of(a, "colornerf")["psnr_rgb"], row_of(b, "colornerf")["psnr_rgb"]);
}

TEST_F(Compare, AMethodThatFailsLeavesARowThatSaysSo) {
  const ProgramResult result = compare(folder_ / "out", "colornerf,grey", {"--colorizer", "exec:false"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto table = json_of(folder_ / "out/table.json");
  EXPECT_THAT(row_of(table, "colornerf")["error"], HasSubstr("exec:false"));
  EXPECT_TRUE(row_of(table, "grey").contains("psnr_rgb"));
}

// A row would be of the method; a disk that fails says nothing of it.
TEST_F(Compare, AFileThatCannotBeWrittenEndsTheComparison) {
  const fs::path out = comparison_of({"colornerf", "grey"});
  const fs::path grey = out / "runs" / tiny_capture().filename() / "seed-1/grey";
  fs::remove(grey / "cell.json");
  fs::remove(grey / "views/0000.jpg");
  fs::create_directories(grey / "views/0000.jpg/in the way");

  const ProgramResult result = compare(out, "colornerf,grey", {"--resume"});
  EXPECT_EQ(result.exit_code, 73);
  EXPECT_THAT(result.err, HasSubstr("0000.jpg"));
  EXPECT_FALSE(fs::exists(grey / "cell.json"));

  fs::remove_all(grey / "views/0000.jpg");
  const ProgramResult mended = compare(out, "colornerf,grey", {"--resume"});
  EXPECT_EQ(mended.exit_code, 0) << mended.err;
  EXPECT_TRUE(fs::exists(grey / "cell.json"));
}

TEST_F(Compare, ACaptureMayHaveASizeOfItsOwn) {
  const std::string small = tiny_capture().string() + "@2";
  const ProgramResult result = cnerf(
      concatenated({"compare", tiny_capture().string(), small, "-o", (folder_ / "out").string(), "--methods", "grey"},
                   tiny_options()));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out + result.err, HasSubstr("24 x 18"));
  EXPECT_EQ(json_of(folder_ / "out/table.json")["tables"].size(), 3u) << "two captures and both together";
  EXPECT_EQ(cnerf({"compare", tiny_capture().string() + "@0", "-o", (folder_ / "no").string()}).exit_code, 64);
}

TEST_F(Compare, NothingIsClearedThatIsOnlyReportedOrForACaptureThatIsNotThere) {
  const TempDir folder;
  const fs::path report = copied(*shared_ / "out", folder / "out");
  const std::vector<std::string> before = files_below(report / "runs");
  EXPECT_EQ(compare(report, "grey", {"--only-report", "--overwrite"}).exit_code, 64);
  EXPECT_NE(cnerf({"compare", "/no/such/capture", "-o", report.string(), "--overwrite"}).exit_code, 0);
  EXPECT_EQ(files_below(report / "runs"), before);
}

TEST_F(Compare, WhatCannotBeComparedIsRefusedBeforeTraining) {
  EXPECT_EQ(compare(folder_ / "out", "colornef").exit_code, 64);
  EXPECT_EQ(compare(folder_ / "out", "grey", {"--colorizer", "simulated:hue=3"}).exit_code, 64);
  EXPECT_EQ(compare(folder_ / "out", "grey", {"--lpips-weights", "missing.bin"}).exit_code, 66);
  const ProgramResult known = compare(folder_ / "out", "grey", {"--set", "colorizer.keyframes=a.png=b.png"});
  EXPECT_EQ(known.exit_code, 64);
  EXPECT_THAT(known.err, HasSubstr("colorizer.keyframes"));
  EXPECT_EQ(cnerf({"compare", "-o", (folder_ / "out").string()}).exit_code, 64);
  EXPECT_FALSE(fs::exists(folder_ / "out"));

  fs::copy(tiny_capture(), folder_ / "grey", fs::copy_options::recursive);
  fs::remove_all(folder_ / "grey/color");
  const ProgramResult grey = cnerf({"compare", (folder_ / "grey").string(), "-o", (folder_ / "out").string()});
  EXPECT_EQ(grey.exit_code, 65);
  EXPECT_THAT(grey.err, HasSubstr("grey"));

  fs::create_directory(folder_ / "full");
  write_file(folder_ / "full/mine.txt", std::string("mine"));
  EXPECT_EQ(compare(folder_ / "full", "grey", {"--overwrite"}).exit_code, 64);
  EXPECT_TRUE(fs::exists(folder_ / "full/mine.txt"));
  EXPECT_EQ(cnerf({"colorize", "x", "--colorizer", "simulated"}).exit_code, 66);  // no such run
}

}  // namespace
}  // namespace cnerf::test
