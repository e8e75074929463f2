#include "src/compare/baselines/flow.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/base/error.h"
#include "src/base/rng.h"

namespace cnerf::test {
namespace {
using namespace compare;

constexpr int kFlowWidth = 128, kFlowHeight = 96;

/// Answers one colour a call: 30, then -30, then 30, …
class Flickering final : public Colorizer {
 public:
  ChromaBatch colorize(const LightnessBatch& patches) override {
    ChromaBatch answer{patches.batch, patches.height, patches.width, {}, {}};
    answer.ab.assign(2 * patches.lightness.size(), calls_++ % 2 == 0 ? 30.0f : -30.0f);
    return answer;
  }
  [[nodiscard]] std::string name() const override { return "flickering"; }

 private:
  int calls_ = 0;
};

/// Smooth noise, moved to the left by `shift` pixels.
LightnessBatch textured(int shift, std::uint64_t seed = 1) {
  cv::Mat noise(kFlowHeight, kFlowWidth + 32, CV_32F);
  const CounterRng rng(seed, 0);
  for (int i = 0; i < int(noise.total()); ++i) noise.ptr<float>()[i] = rng.uniform(std::uint64_t(i));
  cv::GaussianBlur(noise, noise, {}, 3);
  cv::normalize(noise, noise, 10, 90, cv::NORM_MINMAX);
  const cv::Mat part = noise(cv::Rect(shift, 0, kFlowWidth, kFlowHeight)).clone();
  LightnessBatch batch{1, kFlowHeight, kFlowWidth, {part.ptr<float>(), part.ptr<float>() + part.total()}};
  return batch;
}

double mean_a(const ChromaBatch& answer) {
  double sum = 0;
  for (std::size_t i = 0; i < answer.ab.size() / 2; ++i) sum += answer.ab[i];
  return sum / (double(answer.ab.size()) / 2);
}

TEST(FlowColorizer, CarriesColoursAlongWhereTheViewMoved) {
  FlowColorizer flow(std::make_unique<Flickering>());
  EXPECT_NEAR(mean_a(flow.colorize(textured(0))), 30, 1e-4);
  // Where the flow is trusted wholly: 0.8 * 30 + 0.2 * -30 = 18.
  EXPECT_NEAR(mean_a(flow.colorize(textured(3))), 18, 3);
  EXPECT_EQ(flow.name(), "flow over flickering");
}

TEST(FlowColorizer, AnotherSceneIsNotMistakenForTheOneBefore) {
  FlowColorizer flow(std::make_unique<Flickering>());
  (void)flow.colorize(textured(0));
  EXPECT_LT(mean_a(flow.colorize(textured(0, 99))), -10);
}

TEST(FlowColorizer, AViewOfAnotherSizeStartsAfresh) {
  FlowColorizer flow(std::make_unique<Flickering>());
  (void)flow.colorize(textured(0));
  const LightnessBatch small{1, 32, 32, std::vector<float>(32 * 32, 50.0f)};
  EXPECT_NEAR(mean_a(flow.colorize(small)), -30, 1e-4);
}

TEST(FlowColorizer, TakesOneViewAtATime) {
  FlowColorizer flow(std::make_unique<Flickering>());
  const LightnessBatch two{2, 8, 8, std::vector<float>(128, 50.0f)};
  EXPECT_THROW((void)flow.colorize(two), ColorizerError);
}

}  // namespace
}  // namespace cnerf::test
