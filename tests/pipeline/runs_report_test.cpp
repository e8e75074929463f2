#include "src/pipeline/runs_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/base/json_record.h"
#include "src/capture/image_io.h"
#include "src/evaluate/evaluate.h"
#include "src/picture/encode.h"
#include "src/pipeline/run_directory.h"
#include "tests/support/data.h"

namespace cnerf::pipeline {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

/// A finished run: 27.5 dB of two held-out views, a take "warm" of 90 s.
fs::path make_run(const fs::path& folder, int sheet_width = 40) {
  const RunDirectory run(folder);
  RunRecord record;
  record.capture = "/captures/a";
  record.stage1 = {{100, 75, 2e6, 28}, true};
  run.save(record);
  run.save(TakeRecord{"warm", "reference:a.png", {.accepted = 4, .seconds = 90}});
  Metrics metrics;
  metrics.split = "held-out";
  metrics.take = "warm";
  metrics.views.resize(2);
  metrics.mean.psnr_luminance = 27.5;
  metrics.mean.ssim = 0.9125;
  metrics.mean.ab_error = 7.25;
  write_file(run.metrics_file(), json_of(metrics).dump());
  Picture sheet{sheet_width, 20, {}};
  sheet.rgb.assign(std::size_t(sheet_width) * 20 * 3, 200);
  write_png(run.contact_sheet(), sheet);
  return folder;
}

TEST(RunsReport, HasARowAndATileOfEachRun) {
  const test::TempDir folder;
  const std::vector<fs::path> runs = {make_run(folder / "fox"), make_run(folder / "a|b")};
  Observer silent;
  EXPECT_EQ(report_runs(runs, folder / "report", silent), 2);
  const std::string table = read_text_file(folder / "report/table.md");
  EXPECT_THAT(table, HasSubstr("| fox | 1 min 15 s | warm | 1 min 30 s | 2 held-out | 27.50 | 0.912 | - | 7.25 |"));
  EXPECT_THAT(table, HasSubstr("| a\\|b |")) << "a name does not break the table";
  const auto json = nlohmann::json::parse(read_text_file(folder / "report/table.json"));
  ASSERT_EQ(json.at("runs").size(), 2u);
  EXPECT_EQ(json["runs"][0]["metrics"]["mean"]["psnr_luminance"], 27.5);
  EXPECT_EQ(json["runs"][0]["record"]["stage1"]["steps"], 100);
  const LinearImage sheet = read_linear_image(folder / "report/contact_sheet.png", Transfer::kSrgb);
  EXPECT_GE(sheet.width, 2 * 40) << "two tiles side by side";
}

TEST(RunsReport, ShowsTheColumnsThatSomeRunHas) {
  const test::TempDir folder;
  const std::vector<fs::path> runs = {make_run(folder / "fox"), make_run(folder / "fruit")};
  const RunDirectory fruit(runs[1]);
  auto metrics = read_record<Metrics>(fruit.metrics_file());
  metrics.mean.psnr_luminance_aligned = 28.25;
  metrics.mean.near_opacity = 0.0125;
  metrics.spread["psnr_luminance"] = {12.1, "a.png", 17, 22, 26};
  write_file(fruit.metrics_file(), json_of(metrics).dump());
  Observer silent;
  report_runs(runs, folder / "report", silent);
  const std::string table = read_text_file(folder / "report/table.md");
  EXPECT_THAT(table, HasSubstr("| luminance dB | worst | right halves aligned dB | fog before cameras % | SSIM |"));
  EXPECT_THAT(table, HasSubstr("2 held-out | 27.50 | 12.10 | 28.25 | 1.25 | 0.912 |"));
  EXPECT_THAT(table, HasSubstr("2 held-out | 27.50 | - | - | - | 0.912 |")) << "the other run has none of them";
}

/// A job array leaves runs in every state.
TEST(RunsReport, SaysWhatIsNotFinished) {
  const test::TempDir folder;
  const RunDirectory begun(folder / "begun");
  begun.save(RunRecord{});
  Observer silent;
  EXPECT_EQ(report_runs({make_run(folder / "fox"), begun.root()}, folder / "report", silent), 1);
  EXPECT_THAT(read_text_file(folder / "report/table.md"), HasSubstr("| begun | not finished | not evaluated |"));
}

TEST(RunsReport, RefusesWhatIsNoRun) {
  const test::TempDir folder;
  Observer silent;
  EXPECT_THROW(report_runs({}, folder / "report", silent), UsageError);
  EXPECT_THROW(report_runs({folder / "none"}, folder / "report", silent), MissingInputError);
  write_file(RunDirectory(make_run(folder / "fox")).metrics_file(), std::string_view("{}"));
  EXPECT_THROW(report_runs({folder / "fox"}, folder / "report", silent), Error);
  EXPECT_FALSE(fs::exists(folder / "report")) << "nothing is written where something is wrong";
}

}  // namespace
}  // namespace cnerf::pipeline
