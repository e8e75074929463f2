#include "viewer/server/live_feed.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <thread>

namespace cnerf::web {
namespace {
using Json = nlohmann::json;

TEST(LiveFeed, StateHoldsTaskFiguresAndCurves) {
  LiveFeed feed("train photos");
  feed.progress({"stage 1", 0.25, {{"psnr", 20.5}, {"loss", std::numeric_limits<double>::quiet_NaN()}}});
  feed.progress({"stage 1", 0.5, {{"psnr", 22.5}}});
  const Json state = Json::parse(feed.state());
  EXPECT_EQ(state.at("title"), "train photos");
  EXPECT_EQ(state.at("task"), "stage 1");
  EXPECT_EQ(state.at("fraction"), 0.5);
  EXPECT_EQ(state.at("curves").at("stage 1: psnr").size(), 2u);
  EXPECT_EQ(state.at("curves").at("stage 1: psnr").at(1).at(1), 22.5);
  EXPECT_FALSE(state.at("curves").contains("stage 1: loss")) << "what is no number is no point";
}

TEST(LiveFeed, CurvesAreThinnedEvenly) {
  LiveFeed feed("");
  for (int i = 0; i < 10'000; ++i) feed.progress({"t", 0, {{"v", double(i)}}});
  const Json points = Json::parse(feed.state()).at("curves").at("t: v");
  EXPECT_GT(points.size(), 200u);
  EXPECT_LT(points.size(), 500u);
  EXPECT_EQ(points.front().at(1), 0);
  EXPECT_GT(points.back().at(1), 9900);
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    const double step = points[i].at(1).get<double>() - points[i - 1].at(1).get<double>();
    EXPECT_NEAR(step, 32, 32) << i;
  }
}

TEST(LiveFeed, NewsComeOnce) {
  LiveFeed feed("");
  const auto first = feed.wait_for_news(0, 0.01);
  ASSERT_TRUE(first);
  EXPECT_FALSE(feed.wait_for_news(first->first, 0.01));
  std::thread work([&] { feed.say("news"); });
  const auto next = feed.wait_for_news(first->first, 10);
  work.join();
  ASSERT_TRUE(next);
  EXPECT_EQ(Json::parse(next->second).at("message"), "news");
}

TEST(LiveFeed, PicturesAreReplacedByName) {
  LiveFeed feed("");
  feed.picture("a.ours", "1");
  feed.picture("a.ours", "2");
  EXPECT_EQ(feed.picture("a.ours"), "2");
  EXPECT_FALSE(feed.picture("b"));
  EXPECT_EQ(Json::parse(feed.state()).at("pictures").size(), 1u);
}

TEST(LiveFeed, APauseHoldsTheWorkUntilItGoesOnOrStops) {
  LiveFeed feed("");
  EXPECT_LT(feed.wait_while_paused(), 0.05);
  for (const bool stop : {false, true}) {
    feed.request_pause(true);
    std::thread tab([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(80));
      stop ? feed.request_stop() : feed.request_pause(false);
    });
    EXPECT_GE(feed.wait_while_paused(), 0.07);
    tab.join();
  }
  EXPECT_TRUE(feed.stop_requested());
}

TEST(LiveFeed, FinishedWorkCannotBePaused) {
  LiveFeed feed("");
  feed.say("done", true);
  feed.request_pause(true);
  EXPECT_LT(feed.wait_while_paused(), 0.05);
  EXPECT_TRUE(Json::parse(feed.state()).at("finished"));
}

}  // namespace
}  // namespace cnerf::web
