#include "src/compare/table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/compare/methods.h"
#include "src/compare/report.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
using namespace compare;

ComparisonCell cell(const std::string& capture, const std::string& method, int seed, double psnr, double lpips) {
  ComparisonCell made;
  made.capture = capture;
  made.method = method;
  made.seed = seed;
  made.settings = "abc";
  ViewMetrics view;
  view.view = "v<1>";
  view.psnr_rgb = psnr;
  view.lpips = lpips;
  view.colourfulness_difference = -3;
  ViewMetrics other = view;
  other.colourfulness_difference = 5;
  made.metrics = {"held-out", "", "simulated:", mean_of({view, other}), {view, other}};
  made.short_range = {1.5, 4, 1000, 10};
  made.accepted = 3;
  made.rejected = 1;
  return made;
}

std::size_t column(const std::string& name) {
  const auto columns = comparison_columns();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (columns[c].name == name) return c;
  }
  ADD_FAILURE() << "no column " << name;
  return 0;
}

TEST(Comparison, EstimatesAreMeansWithStudentsInterval) {
  EXPECT_FALSE(estimate({}));
  EXPECT_EQ(estimate(std::vector<double>{3.0})->half_width, 0);
  const Estimate three = *estimate(std::vector<double>{1, 2, 3});
  EXPECT_DOUBLE_EQ(three.mean, 2);
  EXPECT_NEAR(three.half_width, 4.303 * 1 / std::sqrt(3.0), 1e-9);  // s = 1
  // From tables: t of 20 degrees is 2.086, of 30 2.042, of 60 2.000.
  for (const auto& [n, t] : {std::pair{21, 2.086}, {31, 2.042}, {61, 2.000}}) {
    std::vector<double> values(std::size_t(n), 0.0);
    values.front() = 1;
    const double mean = 1.0 / n, deviation = std::sqrt((std::pow(1 - mean, 2) + (n - 1) * mean * mean) / (n - 1));
    EXPECT_NEAR(estimate(values)->half_width / (deviation / std::sqrt(double(n))), t, 3e-3);
  }
}

TEST(Comparison, ACellSurvivesItsFile) {
  const TempDir folder;
  ComparisonCell written = cell("flower", "colornerf", 2, 20.5, 0.25);
  written.error = "a \"quoted\" reason";
  write_file(folder / "cell.json", to_json(written));
  const ComparisonCell read = read_cell(folder / "cell.json");
  EXPECT_EQ(to_json(read), to_json(written));
  EXPECT_EQ(read.long_range.pixels, 0u);
  write_file(folder / "cell.json", std::string("{\"capture\": \"flower\"}"));
  EXPECT_THROW((void)read_cell(folder / "cell.json"), InputError);
}

TEST(Comparison, RowsAreMeansOverSeedsAndOfAllCaptures) {
  const std::vector<ComparisonCell> cells = {cell("a", "colornerf", 1, 20, 0.2), cell("a", "colornerf", 2, 22, 0.2),
                                             cell("b", "colornerf", 1, 30, 0.4), cell("b", "colornerf", 2, 32, 0.4)};
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

TEST(Comparison, ADuelIsWonByWhatTheColumnCallsBetter) {
  const std::vector<ComparisonCell> cells = {cell("a", "colornerf", 1, 20, 0.2), cell("a", "colornerf", 2, 22, 0.2),
                                             cell("a", "grey", 1, 1, 1), cell("a", "without-purification", 1, 19, 0.1),
                                             cell("a", "without-purification", 2, 23, 0.4)};
  for (const Duel& duel : duels(cells)) {
    EXPECT_EQ(duel.method, "without-purification");  // grey does not compete
    EXPECT_EQ(duel.pairs, 2);
    if (duel.column->name == std::string("psnr_rgb")) {
      EXPECT_EQ(duel.wins, 1);
      EXPECT_NEAR(duel.mean_gain, 0, 1e-12);
    }
    if (duel.column->name == std::string("lpips")) {
      EXPECT_EQ(duel.wins, 1);
      EXPECT_NEAR(duel.mean_gain, 0.05, 1e-12);
    }
  }
}

TEST(Comparison, AMethodThatFailedLeavesARowThatSaysSo) {
  std::vector<ComparisonCell> cells = {cell("a", "colornerf", 1, 20, 0.2), cell("a", "video-then-fuse", 1, 0, 0)};
  cells[1].error = "no <memory>";
  const auto rows = table_rows(cells, "a");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[1].error, "no <memory>");
  EXPECT_FALSE(rows[1].columns[column("psnr_rgb")]);
  EXPECT_NE(table_markdown(cells, {}).find("`video-then-fuse` failed: no <memory>"), std::string::npos);
  const auto json = nlohmann::json::parse(table_json(cells, {}));
  EXPECT_EQ(json["tables"][0]["rows"][1]["error"], "no <memory>");
  const std::string html = comparison_html(cells, {}, {});
  EXPECT_EQ(html.find("no <memory>"), std::string::npos);  // escaped
}

TEST(Comparison, TheReportNeedsNothingElse) {
  const std::vector<ComparisonCell> cells = {cell("a", "colornerf", 1, 20, 0.2), cell("a", "grey", 1, 18, 0.4)};
  ReportCapture capture{"a", {"v<1>"}, {{"jpeg", {std::byte{1}}}}, {{"jpeg", {std::byte{2}}}}, {}, 12};
  capture.methods.push_back({"colornerf", {{"jpeg", {std::byte{3}}}}, {{"jpeg", {std::byte{4}}}}, {}});
  const std::string html = comparison_html(cells, {"simulated:", "AlexNet", "cnerf compare a"}, std::span(&capture, 1));
  for (const char* outside : {"src=\"http", "href=\"http", "url(", "<link", "@import"}) {
    EXPECT_EQ(html.find(outside), std::string::npos) << outside;
  }
  for (const char* part : {"<table", "type=\"range\"", "Turntables", "<svg", "Table 1", "v&lt;1&gt;"}) {
    EXPECT_NE(html.find(part), std::string::npos) << part;
  }
}

TEST(Comparison, DataUrisAreBase64) {
  const auto uri = [](const std::string& text) {
    const auto bytes = std::as_bytes(std::span(text));
    return data_uri({"png", {bytes.begin(), bytes.end()}});
  };
  // RFC 4648, section 10.
  EXPECT_EQ(uri(""), "data:image/png;base64,");
  EXPECT_EQ(uri("f"), "data:image/png;base64,Zg==");
  EXPECT_EQ(uri("fo"), "data:image/png;base64,Zm8=");
  EXPECT_EQ(uri("foo"), "data:image/png;base64,Zm9v");
  EXPECT_EQ(uri("foobar"), "data:image/png;base64,Zm9vYmFy");
}

TEST(Methods, ListsAreReadAndUnknownOnesRefused) {
  EXPECT_EQ(parse_methods("all").size(), std::size(kMethods));
  const auto two = parse_methods("grey,colornerf,grey");
  ASSERT_EQ(two.size(), 2u);
  EXPECT_STREQ(two[0]->name, "grey");
  EXPECT_THROW((void)parse_methods("colornef"), UsageError);
  EXPECT_THROW((void)parse_methods(""), UsageError);
}

TEST(Methods, AblationsChangeWhatTheyAreNamedAfter) {
  const auto of = [](const char* name) { return stage2_of(*parse_methods(name).front(), Stage2Options{}, {}); };
  const Stage2Options full = of("colornerf");
  EXPECT_TRUE(full.purify.enabled);
  EXPECT_EQ(full.questions, "patches");
  EXPECT_EQ(full.injection, "classification");
  EXPECT_FALSE(of("without-purification").purify.enabled);
  EXPECT_EQ(of("without-purification").injection, full.injection);
  EXPECT_EQ(of("without-classification").injection, "photometric");
  EXPECT_TRUE(of("without-classification").purify.enabled);
  EXPECT_EQ(of("colorize-then-fuse").questions, "views");
  EXPECT_EQ(of("colornerf-paper").decode_temperature, 0);
  EXPECT_EQ(of("colornerf-paper").purify.opinions, 1);
  Stage2Options smooth;
  smooth.spread_weight = 2;
  smooth.regression_weight = 3;
  EXPECT_EQ(stage2_of(*parse_methods("colornerf-paper").front(), smooth, {}).spread_weight, 0) << "not in the paper";
  EXPECT_EQ(stage2_of(*parse_methods("colornerf-paper").front(), smooth, {}).regression_weight, 0);
  EXPECT_EQ(stage2_of(*parse_methods("without-purification").front(), smooth, {}).spread_weight, 2);
  EXPECT_EQ(of("oracle").patches, full.patches);
  EXPECT_EQ(of("positional-encoding").patches, full.patches);
  Stage2Options fast;
  fast.learning_rate = 0.05;
  const auto rate_of = [&](const char* name) {
    return stage2_of(*parse_methods(name).front(), fast, {}).learning_rate;
  };
  EXPECT_EQ(rate_of("without-purification"), 0.05);
  EXPECT_EQ(rate_of("without-classification"), Stage2Options{}.learning_rate) << "its own best step size";
  EXPECT_EQ(of("positional-encoding").learning_rate, CompareOptions{}.positional_learning_rate);
  EXPECT_EQ(of("positional-encoding").injection, full.injection);
}

}  // namespace
}  // namespace cnerf::test
