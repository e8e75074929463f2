#include "src/app/reporter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "src/base/error.h"

namespace cnerf::app {
namespace {

using testing::HasSubstr;

/// What a reporter of `style` prints while `use` uses it.
template <typename Use>
std::string printed(ProgressStyle style, Use use) {
  std::FILE* file = std::tmpfile();
  Reporter reporter(style, file);
  use(reporter);
  std::string text(std::size_t(std::ftell(file)), '\0');
  std::rewind(file);
  text.resize(std::fread(text.data(), 1, text.size(), file));
  std::fclose(file);
  return text;
}

void work(Reporter& reporter) {
  const ProgressSink sink = reporter.progress_sink();
  for (int i = 0; i <= 100; ++i) sink({"stage 1", i / 100.0, {{"psnr", 20.0 + i}, {"rays/s", 213456.0}}});
  reporter.say("a \"message\"");
  reporter.wrote("volume", "/x/volume.vdb");
  reporter.next("do this");
}

TEST(ReporterTest, JsonIsOneObjectALine) {
  std::istringstream lines(printed(ProgressStyle::kJson, work));
  std::vector<std::string> events;
  nlohmann::json last_progress;
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line);
    events.push_back(json.at("event"));
    if (events.back() == "progress") last_progress = json;
  }
  EXPECT_THAT(events, testing::ElementsAre("progress", "progress", "message", "wrote", "next")) << "first and last";
  EXPECT_EQ(last_progress.at("fraction"), 1.0);
  EXPECT_EQ(last_progress.at("figures").at("psnr"), 120.0);
}

TEST(ReporterTest, NumbersThatJsonCannotHoldBecomeNull) {
  const std::string text = printed(ProgressStyle::kJson, [](Reporter& reporter) {
    reporter.progress_sink()({"stage 1", 0.5, {{"psnr", std::numeric_limits<double>::quiet_NaN()}}});
  });
  EXPECT_TRUE(nlohmann::json::parse(text).at("figures").at("psnr").is_null());
}

TEST(ReporterTest, ATerminalGetsOneLineALogGetsLines) {
  const std::string line = printed(ProgressStyle::kLine, work);
  EXPECT_THAT(line, testing::AllOf(HasSubstr("\rstage 1"), HasSubstr("100 %"), HasSubstr("rays/s 213k")));
  EXPECT_THAT(line, HasSubstr("\x1b[K\na \"message\"\n")) << "the message starts on a line of its own";
  const std::string plain = printed(ProgressStyle::kPlain, work);
  EXPECT_THAT(plain, testing::Not(HasSubstr("\r")));
  EXPECT_THAT(plain, HasSubstr("stage 1 100 %"));
  EXPECT_EQ(printed(ProgressStyle::kQuiet, work), "volume:            /x/volume.vdb\n");
}

TEST(ReporterTest, StylesHaveNames) {
  EXPECT_EQ(progress_style("json", stdout), ProgressStyle::kJson);
  EXPECT_THROW((void)progress_style("jsno", stdout), UsageError);
  std::FILE* file = std::tmpfile();
  EXPECT_EQ(progress_style("auto", file), ProgressStyle::kPlain) << "a file is no terminal";
  std::fclose(file);
}

}  // namespace
}  // namespace cnerf::app
