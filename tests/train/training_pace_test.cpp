// When a training that no longer gains is cut short.

#include "src/train/luminance/training_pace.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "src/base/error.h"
#include "src/base/files.h"
#include "src/engine/engines.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/stage1.h"
#include "tests/support/data.h"
#include "tests/support/toy_capture.h"
#include "tests/train/few_steps.h"

namespace cnerf {
namespace {

double same(double own) {
  return own;
}

/// Errors that fall by `gain` dB per tenth of 1000 steps until `until`, and not at all from there on.
double error_at(long step, double gain, long until) {
  return 1e-2 * std::pow(10, -0.1 * gain * double(std::min(step, until)) / 100);
}

long steps_taken(double least_gain, double gain, long until) {
  TrainingPace pace(1000, least_gain);
  long step = 0;
  while (step < pace.steps()) {
    ++step;
    pace.after_step(step, error_at(step, gain, until), same);
  }
  return step;
}

TEST(TrainingPace, WhatGainsTakesAllSteps) {
  EXPECT_EQ(steps_taken(0.1, 0.2, 1000), 1000);
}

TEST(TrainingPace, WhatStopsGainingEndsInTwiceTheStepsUntilThen) {
  // Windows of 50 steps, three of them: the gain to the third is seen at its end.
  EXPECT_EQ(steps_taken(0.1, 0.2, 200), 600);
  EXPECT_EQ(steps_taken(0.1, 0.05, 1000), 300);
}

TEST(TrainingPace, ZeroNeverStopsEarly) {
  EXPECT_EQ(steps_taken(0, 0, 1000), 1000);
}

TEST(TrainingPace, AShortTrainingIsLeftAlone) {
  TrainingPace pace(TrainingPace::kFewest - 1, 10);
  for (long step = 1; step <= 500; ++step) pace.after_step(step, 1e-2, same);
  EXPECT_EQ(pace.steps(), TrainingPace::kFewest - 1);
}

TEST(TrainingPace, OnceTheRateFallsNothingIsAskedAnyMore) {
  TrainingPace pace(1000, 0.1);
  for (long step = 1; step <= 500; ++step) pace.after_step(step, error_at(step, 0.2, 1000), same);
  for (long step = 501; step <= 1000; ++step) {
    pace.after_step(step, 1, [](double) -> double { throw std::runtime_error("asked"); });
  }
  EXPECT_EQ(pace.steps(), 1000);
}

TEST(TrainingPace, GoesOnFromItsStateAsIfItHadNotStopped) {
  TrainingPace whole(1000, 0.1), first(1000, 0.1);
  for (long step = 1; step <= 130; ++step) first.after_step(step, error_at(step, 0.2, 150), same);
  TrainingPace second(1000, 0.1, first.state());
  for (long step = 1; step <= 450; ++step) {
    whole.after_step(step, error_at(step, 0.2, 150), same);
    if (step > 130) second.after_step(step, error_at(step, 0.2, 150), same);
  }
  EXPECT_GT(whole.state().falls_from, 130);
  EXPECT_EQ(second.state().falls_from, whole.state().falls_from);
  EXPECT_EQ(second.state().windows, whole.state().windows);
}

/// As a snapshot of an earlier version, which kept nothing of it.
TEST(TrainingPace, BegunWithinAWindowItCountsWhatItSaw) {
  TrainingPace pace(1000, 0.1);
  for (long step = 41; step <= 150; ++step) pace.after_step(step, 1e-2 * std::pow(10, -0.02 * double(step) / 50), same);
  ASSERT_EQ(pace.state().windows.size(), 3u);
  EXPECT_NEAR(pace.state().windows.front(), 1e-2 * std::pow(10, -0.02 * 45.5 / 50), 1e-5);
  EXPECT_EQ(pace.steps(), 1000) << "0.2 dB per window are gained";
}

TEST(TrainingPace, RanksDecideByTheirMean) {
  TrainingPace pace(1000, 0.1);
  int asked = 0;
  for (long step = 1; step <= 150; ++step) {
    pace.after_step(step, error_at(step, 0.2, 1000), [&](double) {
      ++asked;
      return 1e-2;
    });
  }
  EXPECT_EQ(asked, 3);
  EXPECT_EQ(pace.steps(), 300);
}

/// Cancels after so many steps; 0: never.
struct Impatient final : Observer {
  explicit Impatient(int after) : left(after) {}
  void report_progress(const Progress&) override { --left; }
  [[nodiscard]] bool is_cancelled() const override { return left == 0; }
  int left;
};

TEST(TrainingPace, ATrainingCutShortGoesOnBitForBit) {
  const test::TempDir folder;
  const Capture capture = test::toy_capture();
  Stage1Options options = test::few_steps(1000);
  options.least_gain = 10;  // which no training brings for long
  const auto train = [&](const char* name, int cancelled_after, bool resume) {
    Impatient observer(cancelled_after);
    return train_stage1({capture, options, folder / name, resume}, cpu_engines(), observer);
  };
  const Stage1Report whole = train("whole.snapshot", 0, false);
  EXPECT_LT(whole.steps, 1000);
  EXPECT_GT(whole.steps, 200);
  // Within a window, and where the rate falls already.
  EXPECT_THROW(train("parts.snapshot", 17, false), Interrupted);
  EXPECT_THROW(train("parts.snapshot", whole.steps - 20, true), Interrupted);
  EXPECT_EQ(train("parts.snapshot", 0, true).steps, whole.steps);
  EXPECT_EQ(sha256_of_file(folder / "parts.snapshot"), sha256_of_file(folder / "whole.snapshot"));
}

TEST(TrainingPace, AForgedOneIsRefusedByName) {
  const test::TempDir folder;
  const Capture capture = test::toy_capture();
  const Stage1Options options = test::few_steps(1000);
  LuminanceModel model = LuminanceModel::create(capture, options, cpu_engines());
  PaceState beyond;
  beyond.falls_from = options.steps + 1;
  model.pace = TrainingPace(options.steps, options.least_gain, beyond);
  model.save(folder / "forged.snapshot");
  try {
    (void)LuminanceModel::load(folder / "forged.snapshot", cpu_engines());
    FAIL() << "taken";
  } catch (const SnapshotError& error) {
    EXPECT_THAT(error.what(),
                testing::AllOf(testing::HasSubstr("forged.snapshot"), testing::HasSubstr("pace.falls_from")));
  }
}

}  // namespace
}  // namespace cnerf
