#include "src/compare/table.h"

#include <gtest/gtest.h>

#include <cmath>

#include "src/base/error.h"
#include "src/base/json_record.h"
#include "src/compare/results.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
using namespace compare;

Cell scored_cell(const std::string& capture, const std::string& method, int seed, double psnr, double lpips) {
  Cell made;
  made.capture = capture;
  made.method = method;
  made.seed = seed;
  made.settings = "abc";
  ViewMetrics view;
  view.view = "v<1>";
  view.psnr_rgb = psnr;
  view.lpips = lpips;
  view.colorfulness_difference = -3;
  ViewMetrics other = view;
  other.colorfulness_difference = 5;
  made.metrics.split = "held-out";
  made.metrics.colorizer = "simulated";
  made.metrics.mean = mean_of({view, other});
  made.metrics.views = {view, other};
  made.short_range = {1.5, 4, 1000, 10};
  made.accepted = 3;
  made.rejected = 1;
  return made;
}

std::size_t column(const std::string& name) {
  return std::size_t(&column_named(name) - columns().data());
}

TEST(Comparison, EstimatesAreMeansWithStudentsInterval) {
  EXPECT_FALSE(estimate({}));
  EXPECT_FALSE(estimate(std::vector<double>{3.0})->half_width);
  const Estimate three = *estimate(std::vector<double>{1, 2, 3});
  EXPECT_DOUBLE_EQ(three.mean, 2);
  EXPECT_NEAR(*three.half_width, 4.303 * 1 / std::sqrt(3.0), 1e-9);  // s = 1
  // From tables: t of 20 degrees is 2.086, of 30 2.042, of 60 2.000.
  for (const auto& [n, t] : {std::pair{21, 2.086}, {31, 2.042}, {61, 2.000}}) {
    std::vector<double> values(std::size_t(n), 0.0);
    values.front() = 1;
    const double mean = 1.0 / n, deviation = std::sqrt((std::pow(1 - mean, 2) + (n - 1) * mean * mean) / (n - 1));
    EXPECT_NEAR(*estimate(values)->half_width / (deviation / std::sqrt(double(n))), t, 3e-3);
  }
}

TEST(Comparison, ACellSurvivesItsFile) {
  const TempDir folder;
  Cell written = scored_cell("flower", "colornerf", 2, 20.5, 0.25);
  written.error = "a \"quoted\" reason";
  written.stage1_curve = {{0.5, 20}, {1, 21}};
  write_file(folder / "cell.json", cnerf::json_of(written).dump(2));
  const auto read = read_record<Cell>(folder / "cell.json");
  EXPECT_EQ(cnerf::json_of(read), cnerf::json_of(written));
  EXPECT_EQ(read.long_range.pixels, 0u);
  EXPECT_EQ(read.stage1_curve[1].value, 21);
  write_file(folder / "cell.json", std::string("{\"capture\": \"flower\"}"));
  EXPECT_THROW((void)read_record<Cell>(folder / "cell.json"), InputError);
}

/// As commit 649cb93 wrote it.
TEST(Comparison, ACellOfAnEarlierVersionIsRead) {
  const TempDir folder;
  write_file(folder / "cell.json", std::string(R"({
    "capture": "flower", "method": "grey", "seed": 1, "settings": "ab",
    "metrics": {"schema_version": 1, "split": "held-out", "take": "grey", "colorizer": "",
                "mean": {"psnr_rgb": 18.5}, "views": [{"view": "v1", "psnr_rgb": 18.5, "ssim": 0.5}]},
    "short_range": {"pixels": 0}, "long_range": {"pixels": 7, "mean": 1.5, "p95": 2, "chroma": 3},
    "accepted": 0, "rejected": 0, "seconds": 0.0, "stage1_curve": [[0.5, 20.0], [1.5, 22.0]]})"));
  const auto read = read_record<Cell>(folder / "cell.json");
  EXPECT_EQ(read.metrics.views[0].ssim, 0.5);
  EXPECT_FALSE(read.metrics.mean.lpips);
  EXPECT_EQ(read.long_range.pixels, 7u);
  EXPECT_EQ(read.stage1_curve[1].seconds, 1.5);
}

TEST(Comparison, RowsAreMeansOverSeedsAndOfAllCaptures) {
  const std::vector<Cell> cells = {scored_cell("a", "colornerf", 1, 20, 0.2), scored_cell("a", "colornerf", 2, 22, 0.2),
                                   scored_cell("b", "colornerf", 1, 30, 0.4),
                                   scored_cell("b", "colornerf", 2, 32, 0.4)};
  const auto of_a = table_rows(cells, "a"), of_all = table_rows(cells, "");
  ASSERT_EQ(of_a.size(), 1u);
  EXPECT_DOUBLE_EQ(of_a[0].columns[column("psnr_rgb")]->mean, 21);
  EXPECT_EQ(of_a[0].columns[column("psnr_rgb")]->n, 2);
  EXPECT_DOUBLE_EQ(of_all[0].columns[column("psnr_rgb")]->mean, 26);
  EXPECT_DOUBLE_EQ(of_all[0].columns[column("lpips")]->mean, 0.3);
  EXPECT_DOUBLE_EQ(of_all[0].columns[column("colourfulness_gap")]->mean, 4);  // of |-3| and |5|
  EXPECT_DOUBLE_EQ(of_all[0].columns[column("acceptance")]->mean, 75);
  EXPECT_DOUBLE_EQ(of_all[0].columns[column("short_relative")]->mean, 15);
  EXPECT_FALSE(of_all[0].columns[column("long_range")]);
  EXPECT_FALSE(of_all[0].columns[column("long_relative")]);
}

TEST(Comparison, WhatLacksACaptureHasNoMeanOfAll) {
  std::vector<Cell> cells = {scored_cell("a", "colornerf", 1, 20, 0.2), scored_cell("b", "colornerf", 1, 30, 0.4),
                             scored_cell("b", "colornerf", 2, 40, 0.4), scored_cell("a", "x", 1, 0, 0),
                             scored_cell("b", "x", 1, 30, 0.4),         scored_cell("b", "y", 1, 30, 0.4)};
  cells[3].error = "no memory";
  const std::size_t psnr = column("psnr_rgb");
  const auto of_b = table_rows(cells, "b"), of_all = table_rows(cells, "");
  ASSERT_EQ(of_all.size(), 3u);
  EXPECT_DOUBLE_EQ(of_all[0].columns[psnr]->mean, 25);
  EXPECT_EQ(of_all[0].columns[psnr]->n, 1) << "of seed 2 one capture is missing";
  for (const std::size_t row : {1u, 2u}) {
    EXPECT_FALSE(of_all[row].columns[psnr]) << of_all[row].method;
    EXPECT_DOUBLE_EQ(of_b[row].columns[psnr]->mean, 30);
    EXPECT_FALSE(table_json(cells, {})["tables"][2]["rows"][row].contains("psnr_rgb"));
  }
}

TEST(Comparison, ADuelIsWonByWhatTheColumnCallsBetter) {
  const std::vector<Cell> cells = {scored_cell("a", "colornerf", 1, 20, 0.2), scored_cell("a", "colornerf", 2, 22, 0.2),
                                   scored_cell("a", "grey", 1, 1, 1),
                                   scored_cell("a", "without-purification", 1, 19, 0.1),
                                   scored_cell("a", "without-purification", 2, 23, 0.4)};
  for (const Duel& duel : duels(cells)) {
    EXPECT_EQ(duel.method, "without-purification");  // grey does not compete
    EXPECT_EQ(duel.pairs, 2);
    if (duel.column == "psnr_rgb") {
      EXPECT_EQ(duel.wins, 1);
      EXPECT_NEAR(duel.mean_gain, 0, 1e-12);
    }
    if (duel.column == "lpips") {
      EXPECT_EQ(duel.wins, 1);
      EXPECT_NEAR(duel.mean_gain, 0.05, 1e-12);
    }
  }
}

TEST(Comparison, AMethodThatFailedLeavesARowThatSaysSo) {
  std::vector<Cell> cells = {scored_cell("a", "colornerf", 1, 20, 0.2), scored_cell("a", "video-then-fuse", 1, 0, 0)};
  cells[1].error = "no <memory>";
  const auto rows = table_rows(cells, "a");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[1].error, "no <memory>");
  EXPECT_FALSE(rows[1].columns[column("psnr_rgb")]);
  EXPECT_NE(table_markdown(cells, {}).find("`video-then-fuse` failed: no <memory>"), std::string::npos);
  EXPECT_EQ(table_json(cells, {})["tables"][0]["rows"][1]["error"], "no <memory>");
}

}  // namespace
}  // namespace cnerf::test
