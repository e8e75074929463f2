#include "src/prepare/film.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "src/base/rng.h"

namespace cnerf::prepare {
namespace {

using testing::ElementsAre;

/// Blobs at random places: the same seed gives the same picture, shifted by `x`, `y`.
cv::Mat1b picture(int seed, double x = 0, double y = 0, cv::Size size = {320, 240}) {
  SequentialRng rng(std::uint64_t(seed), 0);
  cv::Mat1f out(size, 110.0f);
  for (int i = 0; i < 60; ++i) {
    const cv::Point2d at(rng.uniform() * 1.4 * size.width + x - 0.2 * size.width, rng.uniform() * size.height + y);
    const int radius = 4 + int(rng.below(18));
    const float code = 40 + 170 * rng.uniform();
    cv::circle(out, cv::Point(int(at.x * 16), int(at.y * 16)), radius * 16, cv::Scalar(code), cv::FILLED, cv::LINE_AA,
               4);
  }
  cv::GaussianBlur(out, out, {0, 0}, 0.8);
  cv::Mat1b codes;
  out.convertTo(codes, CV_8U);
  return codes;
}

void add_grain(cv::Mat1b& frame, double codes, int seed) {
  SequentialRng rng(std::uint64_t(seed), 1);
  for (std::uint8_t& code : frame) code = cv::saturate_cast<std::uint8_t>(code + codes * rng.normal());
}

std::vector<FrameFacts> facts_of(const std::vector<cv::Mat1b>& frames) {
  FrameObserver observer;
  std::vector<FrameFacts> facts;
  for (const cv::Mat1b& frame : frames) facts.push_back(observer.measure(frame));
  return facts;
}

Shot whole(const std::vector<FrameFacts>& facts) {
  return {0, int(facts.size())};
}

TEST(Shots, ACutSplitsAndAPanDoesNot) {
  std::vector<cv::Mat1b> frames;
  for (int i = 0; i < 20; ++i) frames.push_back(picture(1, 3 * i));
  for (int i = 0; i < 15; ++i) frames.push_back(picture(2, -4 * i));
  const std::vector<Shot> shots = find_shots(facts_of(frames));
  ASSERT_EQ(shots.size(), 2u);
  EXPECT_EQ(shots[0].end, 20);
  EXPECT_EQ(shots[1].begin, 20);
  EXPECT_EQ(shots[1].end, 35);
}

TEST(Shots, FlickerIsNoCut) {
  std::vector<cv::Mat1b> frames;
  for (int i = 0; i < 20; ++i) frames.push_back(cv::Mat1b(picture(1, 2 * i) * (i % 2 == 0 ? 0.7 : 1.0)));
  EXPECT_EQ(find_shots(facts_of(frames)).size(), 1u);
}

TEST(Duplicates, RepeatedFramesAreFoundAndOthersNot) {
  std::vector<cv::Mat1b> frames;
  for (int i = 0; i < 24; ++i) {
    frames.push_back(picture(1, 2 * i));
    add_grain(frames.back(), 2, i);
    if (i % 6 == 5) frames.push_back(frames.back().clone());
  }
  const auto facts = facts_of(frames);
  const std::vector<bool> found = find_duplicates(facts, whole(facts));
  std::vector<int> numbers;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i]) numbers.push_back(int(i));
  }
  EXPECT_THAT(numbers, ElementsAre(6, 13, 20, 27));
}

TEST(Comb, WovenFieldsStandOut) {
  const cv::Mat1b now = picture(1), later = picture(1, 6);
  cv::Mat1b woven = now.clone();
  for (int y = 1; y < woven.rows; y += 2) later.row(y).copyTo(woven.row(y));
  EXPECT_LT(comb_ratio(now), 0.8);
  EXPECT_GT(comb_ratio(woven), 1.2);
}

TEST(Borders, LetterboxIsCut) {
  BorderFinder borders;
  for (int i = 0; i < 12; ++i) {
    cv::Mat1b frame(240, 320, std::uint8_t(16));
    picture(1, 5 * i, 0, {320, 180}).copyTo(frame.rowRange(30, 210));
    add_grain(frame, 1, i);
    borders.add(frame);
  }
  const cv::Rect kept = borders.picture();
  EXPECT_EQ(kept.x, 0);
  EXPECT_EQ(kept.width, 320);
  EXPECT_NEAR(kept.y, 32, 1);  // two rows beside the bar are mixed with it
  EXPECT_NEAR(kept.y + kept.height, 208, 1);
}

TEST(Borders, APictureWithoutBarsStaysWhole) {
  BorderFinder borders;
  for (int i = 0; i < 12; ++i) borders.add(picture(1, 5 * i));
  EXPECT_EQ(borders.picture(), cv::Rect(0, 0, 320, 240));
}

TEST(ChooseFrames, TakesTheSharpestOfEachWindow) {
  std::vector<FrameFacts> facts(12);
  for (std::size_t i = 0; i < facts.size(); ++i) facts[i].sharpness = 1;
  facts[1].sharpness = facts[6].sharpness = facts[11].sharpness = 2;
  facts[7].sharpness = 3;
  std::vector<bool> left_out(12);
  left_out[7] = true;
  EXPECT_THAT(choose_frames(facts, {0, 12}, left_out, 3), ElementsAre(1, 6, 11));
}

}  // namespace
}  // namespace cnerf::prepare
