/// The pages of a comparison: that they need nothing else, and what a browser makes of them.

#include "src/compare/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/base/json_record.h"
#include "src/base/process.h"
#include "src/compare/page.h"
#include "src/compare/rating.h"
#include "tests/support/data.h"

namespace cnerf::compare {
namespace {
using test::TempDir;
using testing::HasSubstr;
using testing::Not;

Cell cell(const std::string& method, int seed) {
  Cell made;
  made.capture = "a";
  made.method = method;
  made.seed = seed;
  ViewMetrics view;
  view.view = "v<1>";
  view.psnr_rgb = 20 + seed;
  made.metrics.views = {view};
  made.metrics.mean.psnr_rgb = view.psnr_rgb;
  made.stage1_curve = {{1, 20}, {2, 21}};
  return made;
}

std::string report() {
  std::vector<Cell> cells = {cell("colornerf", 1), cell("colornerf", 2), cell("positional-encoding", 1),
                             cell("grey", 1)};
  cells.back().error = "no <memory> </script>";
  ReportCapture capture;
  capture.name = "a";
  capture.views = {"v<1>"};
  capture.inputs = {"data:image/png;base64,AA=="};
  capture.truths = {"data:image/png;base64,AQ=="};
  capture.methods = {{"colornerf", {"data:image/png;base64,Ag=="}, {"data:image/png;base64,Aw=="}, {{"bases", "x"}}}};
  return report_html(cells, {"simulated", "AlexNet", "cnerf compare a"}, std::span(&capture, 1));
}

/// The elements that a browser has after the page's script.
std::optional<std::string> as_shown(const std::string& html) {
  const auto browser = find_program("chromium") ? find_program("chromium") : find_program("google-chrome");
  if (!browser) return std::nullopt;
  const TempDir folder;
  write_file(folder / "page.html", html);
  const std::string url = "file://" + (folder / "page.html").string();
  const int status = run_program({browser->string(), "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom",
                                  "--user-data-dir=" + (folder / "profile").string(), url},
                                 folder / "dom.html");
  EXPECT_EQ(status, 0);
  return read_text_file(folder / "dom.html");
}

std::string without_scripts(std::string dom) {
  for (auto begin = dom.find("<script"); begin != std::string::npos; begin = dom.find("<script")) {
    dom.erase(begin, dom.find("</script>", begin) + 9 - begin);
  }
  return dom;
}

TEST(Report, NeedsNothingElse) {
  for (const std::string& html :
       {report(), make_rating_sheet({{"a", "v", "m", "data:image/png;base64,AA=="}}, 1).html}) {
    for (const char* outside : {"src=\"http", "href=\"http", "url(", "<link", "@import", "{{"}) {
      EXPECT_THAT(html, Not(HasSubstr(outside)));
    }
  }
}

TEST(Report, DataCannotEndItsElement) {
  const std::string html = report();
  EXPECT_THAT(html, Not(HasSubstr("<memory>")));
  const std::string opening = "<script type=\"application/json\" id=\"data\">";
  const auto begin = html.find(opening) + opening.size();
  const auto data = nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin));
  EXPECT_EQ(data["table"]["cells"][3]["error"], "no <memory> </script>");
  EXPECT_EQ(data["captures"][0]["methods"][0]["galleries"][0]["title"], "bases");
}

TEST(Report, ABrowserShowsTablesPicturesAndPlots) {
  const auto dom = as_shown(report());
  if (!dom) GTEST_SKIP() << "needs chromium";
  const std::string body = without_scripts(*dom);
  for (const char* part : {"<table", "type=\"range\"", "Turntables", "<svg", "Table 1", "v&lt;1&gt;", "Each view",
                           "Over seeds", "Purification", "Training times", "21.50 ± 6.35",
                           "grey failed: no &lt;memory&gt;", "src=\"data:image/png;base64,Ag==\""}) {
    EXPECT_THAT(body, HasSubstr(part));
  }
}

TEST(Report, ABrowserShowsTheRatingSheet) {
  const auto dom = as_shown(make_rating_sheet({{"a", "v", "m", "data:image/png;base64,AA=="}}, 1).html);
  if (!dom) GTEST_SKIP() << "needs chromium";
  EXPECT_THAT(without_scripts(*dom),
              HasSubstr("<figure id=\"1\"><img alt=\"picture 1\" src=\"data:image/png;base64,AA==\">"));
  EXPECT_THAT(without_scripts(*dom), HasSubstr("name=\"1-vividness\""));
}

TEST(Report, DataUrisAreBase64) {
  const auto uri = [](const std::string& text) { return data_uri("png", std::as_bytes(std::span(text))); };
  // RFC 4648, section 10.
  EXPECT_EQ(uri(""), "data:image/png;base64,");
  EXPECT_EQ(uri("f"), "data:image/png;base64,Zg==");
  EXPECT_EQ(uri("fo"), "data:image/png;base64,Zm8=");
  EXPECT_EQ(uri("foo"), "data:image/png;base64,Zm9v");
  EXPECT_EQ(uri("foobar"), "data:image/png;base64,Zm9vYmFy");
}

}  // namespace
}  // namespace cnerf::compare
