#include "src/compare/baselines/simulated.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "src/base/error.h"
#include "src/color/ab_bins.h"
#include "src/color/colorspace_math.h"
#include "tests/support/data.h"

namespace cnerf::test {
namespace {
using namespace compare;

constexpr int kSide = 32;

/// A capture of two training views: the left half of each picture is red, the right half blue.
class SimulatedColorizerTest : public testing::Test {
 protected:
  void SetUp() override {
    cv::Mat picture(kSide, kSide, CV_8UC3, cv::Scalar(40, 40, 200));
    picture(cv::Rect(kSide / 2, 0, kSide / 2, kSide)).setTo(cv::Scalar(200, 60, 40));
    for (const char* name : {"a", "b"}) {
      View view;
      view.name = name;
      view.image_file = folder_ / (std::string(name) + ".png");
      cv::imwrite(view.image_file.string(), picture);
      view.intrinsics = {LensModel::kPinhole, kSide, kSide, kSide, kSide, kSide / 2.0, kSide / 2.0, {}};
      view.image.width = view.image.height = kSide;
      view.image.u8.assign(kSide * kSide, 80);
      capture_.views.push_back(view);
    }
    red_ = ab_of_rgb(200, 40, 40);
    blue_ = ab_of_rgb(40, 60, 200);
  }

  static Ab ab_of_rgb(int r, int g, int b) {
    const auto linear = [](int v) { return linear_from_srgb(float(v) / 255.0f); };
    const Lab<float> lab = lab_from_linear_rgb(Vec3f{linear(r), linear(g), linear(b)});
    return {lab.a, lab.b};
  }

  /// A square of 8 x 8 pixels from the middle of a half.
  static LightnessBatch question(std::uint64_t query, bool of_right_half = false, const std::string& view = "a") {
    LightnessBatch batch{1, 8, 8, std::vector<float>(64, 50.0f)};
    batch.origins.push_back({view, of_right_half ? 0.625 : 0.125, 0.25, 0.25, 0.25, query});
    return batch;
  }

  [[nodiscard]] Ab answer(const SimulationOptions& options, std::uint64_t query, bool of_right_half = false) const {
    const auto colorizer = make_simulated_colorizer(capture_, options);
    return first_of(colorizer->colorize(question(query, of_right_half)));
  }

  static Ab first_of(const ChromaBatch& answer) { return {answer.ab.front(), answer.ab[answer.ab.size() / 2]}; }
  static double distance(Ab x, Ab y) { return std::hypot(x.a - y.a, x.b - y.b); }
  static double chroma(Ab x) { return std::hypot(x.a, x.b); }
  static double degrees_between(Ab x, Ab y) {
    const double turn = (std::atan2(x.b, x.a) - std::atan2(y.b, y.a)) * 180 / M_PI;
    return std::remainder(turn, 360.0);
  }

  TempDir folder_;
  Capture capture_;
  Ab red_, blue_;
};

TEST_F(SimulatedColorizerTest, TheOracleAnswersTheTruthOfTheRectangle) {
  EXPECT_LT(distance(answer(oracle_simulation(), 1), red_), 1e-3);
  EXPECT_LT(distance(answer(oracle_simulation(), 2, true), blue_), 1e-3);
  LightnessBatch whole{1, kSide, kSide, std::vector<float>(kSide * kSide, 50.0f)};
  whole.origins.push_back({"b", 0, 0, 1, 1, 0});
  const ChromaBatch all = make_simulated_colorizer(capture_, oracle_simulation())->colorize(whole);
  EXPECT_NEAR(all.ab[0], red_.a, 1e-3);
  EXPECT_NEAR(all.ab[kSide / 2], blue_.a, 1e-3);
}

TEST_F(SimulatedColorizerTest, AQueryHasOneAnswerAndAnotherQueryAnother) {
  const SimulationOptions options;
  EXPECT_EQ(distance(answer(options, 5), answer(options, 5)), 0);
  int different = 0;
  for (std::uint64_t query = 0; query < 20; ++query) {
    different += distance(answer(options, query), answer(options, query + 100)) > 0.5 ? 1 : 0;
  }
  EXPECT_GE(different, 18);
  SimulationOptions other = options;
  other.seed = 2;
  EXPECT_GT(distance(answer(options, 5), answer(other, 5)), 0.1);
}

TEST_F(SimulatedColorizerTest, HuesTurnUniformlyWithinTheirLimit) {
  SimulationOptions options = oracle_simulation();
  options.hue = 25;
  double largest = 0, sum = 0, squares = 0;
  constexpr int kQueries = 400;
  for (int query = 0; query < kQueries; ++query) {
    const Ab color = answer(options, std::uint64_t(query));
    EXPECT_NEAR(chroma(color), chroma(red_), 1e-3);
    const double turn = degrees_between(color, red_);
    largest = std::max(largest, std::abs(turn));
    sum += turn;
    squares += turn * turn;
  }
  EXPECT_LE(largest, 25.001);
  EXPECT_GT(largest, 24);
  EXPECT_NEAR(sum / kQueries, 0, 3 * 25 / std::sqrt(3.0 * kQueries));
  EXPECT_NEAR(std::sqrt(squares / kQueries), 25 / std::sqrt(3.0), 1.5);
}

TEST_F(SimulatedColorizerTest, SharesOfModesAndOutliersAreAsTold) {
  SimulationOptions modes = oracle_simulation(), outliers = oracle_simulation();
  modes.modes = 0.3;
  outliers.outliers = 0.15;
  int washed_out = 0, wrong = 0;
  constexpr int kQueries = 600;
  for (std::uint64_t query = 0; query < kQueries; ++query) {
    washed_out += distance(answer(modes, query), red_) > 1 ? 1 : 0;
    const Ab color = answer(outliers, query);
    wrong += distance(color, red_) > 1 ? 1 : 0;
  }
  EXPECT_NEAR(washed_out / double(kQueries), 0.3, 4 * std::sqrt(0.3 * 0.7 / kQueries));
  EXPECT_NEAR(wrong / double(kQueries), 0.15, 4 * std::sqrt(0.15 * 0.85 / kQueries));
}

TEST_F(SimulatedColorizerTest, TheBiasIsTheSameInEveryAnswerAndDependsOnTheContent) {
  SimulationOptions options = oracle_simulation();
  options.bias = 12;
  const double of_red = degrees_between(answer(options, 1), red_);
  EXPECT_NEAR(degrees_between(answer(options, 77), red_), of_red, 1e-3);
  EXPECT_LE(std::abs(of_red), 12.001);
  EXPECT_GT(std::abs(degrees_between(answer(options, 1, true), blue_) - of_red), 0.5);
}

TEST_F(SimulatedColorizerTest, RefusesWhatItCannotKnow) {
  const auto colorizer = make_simulated_colorizer(capture_, {});
  LightnessBatch nowhere = question(1);
  nowhere.origins.clear();
  EXPECT_THROW((void)colorizer->colorize(nowhere), ColorizerError);
  EXPECT_THROW((void)colorizer->colorize(question(1, false, "c")), ColorizerError);
  cv::imwrite((folder_ / "a.png").string(), cv::Mat(kSide, kSide, CV_8U, cv::Scalar(90)));
  EXPECT_THROW((void)make_simulated_colorizer(capture_, {}), InputError);
}

TEST_F(SimulatedColorizerTest, HeldOutViewsAreNotLookedAt) {
  capture_.views[1].held_out = true;
  const auto colorizer = make_simulated_colorizer(capture_, {});
  EXPECT_THROW((void)colorizer->colorize(question(1, false, "b")), ColorizerError);
}

TEST(SimulatedColorizer, IsNoColorizerAUserCanTrainWith) {
  ColorizerOptions options;
  options.spec = kSimulated;
  EXPECT_THROW((void)make_colorizer(options), UsageError);
}

}  // namespace
}  // namespace cnerf::test
