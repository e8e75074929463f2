// Learning curves: what is read off them, and that measuring costs no training time.

#include "src/compare/learning_curve.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace cnerf::compare {
namespace {

const std::vector<LearningPoint> kRising = {{1, 10}, {2, 20}, {4, 24}};

TEST(LearningCurve, TimeToAValueLiesBetweenItsPoints) {
  EXPECT_DOUBLE_EQ(seconds_to(kRising, 15, 1).value(), 1.5);
  EXPECT_DOUBLE_EQ(seconds_to(kRising, 22, 1).value(), 3);
  EXPECT_DOUBLE_EQ(seconds_to(kRising, 5, 1).value(), 1) << "it was there from the beginning";
  EXPECT_FALSE(seconds_to(kRising, 24.1, 1));
  const std::vector<LearningPoint> falling = {{1, 30}, {3, 10}};
  EXPECT_DOUBLE_EQ(seconds_to(falling, 20, -1).value(), 2);
  EXPECT_FALSE(seconds_to(falling, 9, -1));
  EXPECT_FALSE(seconds_to({}, 1, 1));
}

TEST(LearningCurve, ValueAtATime) {
  EXPECT_DOUBLE_EQ(value_at(kRising, 3), 22);
  EXPECT_DOUBLE_EQ(value_at(kRising, 0.1), 10);
  EXPECT_DOUBLE_EQ(value_at(kRising, 9), 24);
}

TEST(LearningCurve, MeasuringAndWhatComesBeforeAreNoTraining) {
  using namespace std::chrono_literals;
  int measured = 0;
  struct Counting final : Observer {
    int reports = 0;
    void report_progress(const Progress& /*progress*/) override { ++reports; }
  } counting;
  LearningCurve curve("train", counting, [&] {
    std::this_thread::sleep_for(60ms);
    return double(++measured);
  });
  const ProgressSink sink = curve.progress_sink();
  sink({"cache", 0.5, {}});
  std::this_thread::sleep_for(120ms);
  sink({"cache", 1, {}});
  for (int step = 0; step < 40; ++step) {
    std::this_thread::sleep_for(5ms);
    sink({"train", step / 40.0, {}});
  }
  const double whole = curve.seconds();
  EXPECT_EQ(counting.reports, 42);
  ASSERT_GE(curve.points().size(), 3u);
  EXPECT_LT(curve.points().size(), 20u) << "not at every step";
  EXPECT_LT(curve.points().front().seconds, 0.1) << "the caching counted";
  EXPECT_GE(whole, 0.19) << "39 pauses of 5 ms and more";
  for (std::size_t i = 1; i < curve.points().size(); ++i) {
    EXPECT_GT(curve.points()[i].seconds, curve.points()[i - 1].seconds);
  }
  // On a busy machine sleeps are longer, but measuring them 60 ms each would show: without the pauses the last point
  // would lie as far behind as all of them took.
  EXPECT_LT(whole, 0.2 + 0.03 * measured + 1.0);
}

}  // namespace
}  // namespace cnerf::compare
