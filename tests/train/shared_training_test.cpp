/// Trainings that several ranks share, with threads for processes: the same bits for the same number of ranks, and
/// rounding apart from one process.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>
#include <set>

#include "src/base/files.h"
#include "src/train/luminance/luminance_model.h"
#include "src/train/luminance/shared_steps.h"
#include "tests/cluster/fake_channel.h"
#include "tests/support/engine_state.h"
#include "tests/support/stage2_fixture.h"

namespace cnerf {
namespace {

using test::on_ranks;

Stage1Options few_steps() {
  Stage1Options options;
  options.grid.levels = 4;
  options.grid.log2_rows = 12;
  options.grid.finest_resolution = 64;
  options.steps = 48;
  options.samples_per_step = 1 << 12;
  options.steps_per_box = 64;
  options.occupancy.resolution = 32;
  options.checkpoint_every = 20;
  options.exposures = true;
  options.poses = true;
  return options;
}

Stage1Report train(const Capture& capture, const std::filesystem::path& snapshot, cluster::Ranks& ranks,
                   const Stage1Options& options = few_steps(), bool resume = false) {
  Observer silent;
  Stage1Job job{.capture = capture, .options = options, .snapshot = snapshot, .resume = resume, .ranks = ranks};
  return train_stage1(job, cpu_engines(), silent);
}

std::string trained_by(int size, const std::filesystem::path& folder, const Stage1Options& options = few_steps()) {
  const Capture capture = test::toy_capture();
  const auto snapshot = folder / "stage1.snapshot";
  on_ranks(size, [&](cluster::Ranks& ranks) { train(capture, snapshot, ranks, options); });
  return sha256_of_file(snapshot);
}

TEST(SharedStage1, EqualNumbersOfRanksGiveEqualBits) {
  const test::TempDir folder;
  EXPECT_EQ(trained_by(2, folder / "a"), trained_by(2, folder / "b"));
  EXPECT_EQ(trained_by(3, folder / "c"), trained_by(3, folder / "d"));
}

TEST(SharedStage1, AllRanksEndAtTheStepThatTheyAgreeOn) {
  const test::TempDir folder;
  const Capture capture = test::toy_capture();
  Stage1Options options = few_steps();
  options.steps = 1000;
  options.least_gain = 10;  // which no training brings for long
  std::array<int, 2> steps{};
  on_ranks(2, [&](cluster::Ranks& ranks) {
    steps[std::size_t(ranks.rank())] = train(capture, folder / "stage1.snapshot", ranks, options).steps;
  });
  EXPECT_LT(steps[0], options.steps);
  EXPECT_EQ(steps[0], steps[1]);
}

/// Every rank has the whole field: no rank's state differs, though one alone writes.
TEST(SharedStage1, AllRanksHoldTheSameField) {
  const Capture capture = test::toy_capture();
  std::mutex mutex;
  std::vector<std::vector<std::byte>> states;
  on_ranks(3, [&](cluster::Ranks& ranks) {
    LuminanceModel model = LuminanceModel::create(capture, few_steps(), cpu_engines());
    model.engine->set_views(training_views(capture, model.frame));
    model.engine->share_steps(share_of(ranks));
    for (int step = 0; step < 20; ++step) model.engine->step(1e-2f);
    std::vector<std::byte> bytes;
    for (const StatePiece& piece : model.engine->state()) {
      bytes.insert(bytes.end(), piece.bytes.begin(), piece.bytes.end());
    }
    const std::lock_guard lock(mutex);
    states.push_back(std::move(bytes));
  });
  EXPECT_EQ(states[0], states[1]);
  EXPECT_EQ(states[0], states[2]);
}

double largest(std::span<const float> values) {
  double most = 0;
  for (const float value : values) most = std::max(most, double(std::abs(value)));
  return most;
}

double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(double(a[i]) - double(b[i])));
  return most;
}

/// Sums of some thousand floats in another order; a rank that is left out changes a third or more.
constexpr double kOrderOfASum = 1e-5;

TEST(SharedStage1, AStepIsThatOfOneProcessButForRounding) {
  const Capture capture = test::toy_capture();
  const auto gradients = [&](cluster::Ranks& ranks) {
    LuminanceModel model = LuminanceModel::create(capture, few_steps(), cpu_engines());
    model.engine->set_views(training_views(capture, model.frame));
    model.engine->step(1e-3f);  // the first one visits the occupancy grid
    model.engine->share_steps(share_of(ranks));
    return test::gradients_of_next_step(*model.engine);
  };
  const test::Stage1Gradients alone = gradients(cluster::alone());
  for (const int size : {2, 5}) {
    on_ranks(size, [&](cluster::Ranks& ranks) {
      const test::Stage1Gradients shared = gradients(ranks);
      EXPECT_EQ(shared.report.rays, alone.report.rays);
      EXPECT_EQ(shared.report.trained_samples, alone.report.trained_samples);
      EXPECT_NEAR(shared.report.loss, alone.report.loss, 1e-6 * alone.report.loss);
      using Part = std::vector<float> test::Stage1Gradients::*;
      for (const Part part :
           {&test::Stage1Gradients::table, &test::Stage1Gradients::weights, &test::Stage1Gradients::views}) {
        const std::vector<float>& expected = alone.*part;
        ASSERT_FALSE(expected.empty());
        ASSERT_GT(largest(expected), 0);
        EXPECT_LE(largest_difference(shared.*part, expected), kOrderOfASum * largest(expected));
      }
    });
  }
}

/// Over many steps rounding grows, as it does from one processor to another: the pictures are equally good.
TEST(SharedStage1, ATrainingIsAsGoodAsThatOfOneProcess) {
  const test::TempDir folder;
  const Capture capture = test::toy_capture();
  const Stage1Report alone = train(capture, folder / "alone.snapshot", cluster::alone());
  on_ranks(2, [&](cluster::Ranks& ranks) {
    const Stage1Report shared = train(capture, folder / "shared.snapshot", ranks);
    EXPECT_EQ(shared.steps, alone.steps);
    EXPECT_NEAR(shared.train_psnr, alone.train_psnr, 0.2);
    EXPECT_NEAR(shared.trained_samples, alone.trained_samples, 0.02 * alone.trained_samples);
  });
}

TEST(SharedStage1, GoesOnBitForBit) {
  const test::TempDir folder;
  const Capture capture = test::toy_capture();
  const std::string whole = trained_by(2, folder / "whole");
  const auto snapshot = folder / "parts/stage1.snapshot";

  /// Stops when it has had some steps; only one of the ranks has such a user.
  class Stopping : public Observer {
   public:
    explicit Stopping(bool stops) : stops_(stops) {}
    void report_progress(const Progress&) override { ++reports_; }
    [[nodiscard]] bool is_cancelled() const override { return stops_ && reports_ > 20; }

   private:
    bool stops_;
    int reports_ = 0;
  };
  const auto stopped = [&](cluster::Ranks& ranks) {
    Stopping observer(ranks.rank() == 1);
    const Stage1Options options = few_steps();
    Stage1Job job{.capture = capture, .options = options, .snapshot = snapshot, .ranks = ranks};
    EXPECT_THROW(train_stage1(job, cpu_engines(), observer), Interrupted);
  };
  on_ranks(2, stopped);
  const long stopped_at = LuminanceModel::load(snapshot, cpu_engines()).engine->step_count();
  EXPECT_GE(stopped_at, 21);
  EXPECT_LE(stopped_at, 21 + 16) << "ranks ask each other at least every 16 steps";
  on_ranks(2, [&](cluster::Ranks& ranks) { train(capture, snapshot, ranks, few_steps(), /*resume=*/true); });
  EXPECT_EQ(sha256_of_file(snapshot), whole);
}

/// Ranks whose clocks differ are of one mind about the time.
TEST(SharedStage1, TimeIsRankZeros) {
  const test::TempDir folder;
  Stage1Options options = few_steps();
  options.max_seconds = 0.2;
  options.steps = 1'000'000;
  const Capture capture = test::toy_capture();
  std::mutex mutex;
  std::set<int> steps;
  on_ranks(2, [&](cluster::Ranks& ranks) {
    const Stage1Report report = train(capture, folder / "a.snapshot", ranks, options);
    const std::lock_guard lock(mutex);
    steps.insert(report.steps);
  });
  EXPECT_EQ(steps.size(), 1u);
}

using SharedStage2 = test::Stage2Fixture;

TEST_F(SharedStage2, RanksShareQuestionsAndSteps) {
  Stage2Options options = small_options();
  options.distill_steps = 2;
  std::mutex mutex;
  std::multiset<std::uint64_t> asked;
  const auto colorized = [&](const std::string& name) {
    on_ranks(2, [&](cluster::Ranks& ranks) {
      Observer silent;
      test::Listening colorizer;
      const Stage2Job job{.capture = capture_,
                          .stage1 = stage1(),
                          .options = options,
                          .colorizer = colorizer,
                          .known = {},
                          .take = take(name),
                          .ranks = ranks};
      const Stage2Report report = train_stage2(job, cpu_engines(), silent);
      EXPECT_GE(report.accepted, options.patches);
      const std::lock_guard lock(mutex);
      for (const PatchOrigin& origin : colorizer.origins) asked.insert(origin.query);
    });
    return sha256_of_file(take(name));
  };
  const std::string first = colorized("a");
  EXPECT_EQ(std::set<std::uint64_t>(asked.begin(), asked.end()).size(), asked.size()) << "nothing was asked twice";
  EXPECT_EQ(first, colorized("b"));
  EXPECT_LT(distance_to_answer("a"), 5);

  test::Listening colorizer;
  (void)colorize(options, colorizer, take("alone"));
  EXPECT_NEAR(distance_to_answer("a"), distance_to_answer("alone"), 0.5);
}

TEST_F(SharedStage2, RanksShareHowSureAnswersAre) {
  Stage2Options options = small_options();
  options.purify.enabled = false;
  options.sure_colors = 10;
  on_ranks(2, [&](cluster::Ranks& ranks) {
    Observer silent;
    test::Wavering colorizer;
    (void)train_stage2({.capture = capture_,
                        .stage1 = stage1(),
                        .options = options,
                        .colorizer = colorizer,
                        .known = {},
                        .take = take("a"),
                        .ranks = ranks},
                       cpu_engines(), silent);
  });
  EXPECT_LT(distance_to_answer("a"), 5);
}

/// The views' cache is traced by all and equal for all.
TEST_F(SharedStage2, ViewsAreTracedForEachOther) {
  const LuminanceModel model = LuminanceModel::load(stage1(), cpu_engines());
  ViewCache alone;
  const auto silent = [](double) {};
  alone.fill(model.seen(), capture_, model.frame, 20, silent);
  on_ranks(2, [&](cluster::Ranks& ranks) {
    const LuminanceModel own = LuminanceModel::load(stage1(), cpu_engines());
    ViewCache shared;
    shared.trace_with(ranks);
    int reports = 0;
    shared.fill(own.seen(), capture_, own.frame, 20, [&](double) { ++reports; });
    ASSERT_EQ(shared.views().size(), alone.views().size());
    EXPECT_EQ(reports, ranks.is_first() ? 3 : 2) << "of five views";
    for (std::size_t v = 0; v < alone.views().size(); ++v) {
      EXPECT_EQ(shared.views()[v].luminance, alone.views()[v].luminance);
      EXPECT_EQ(shared.views()[v].offsets, alone.views()[v].offsets);
      EXPECT_EQ(shared.views()[v].opacity, alone.views()[v].opacity);
    }
  });
}

}  // namespace
}  // namespace cnerf
