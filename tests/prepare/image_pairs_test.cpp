#include "src/prepare/image_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "src/base/rng.h"
#include "src/prepare/colmap.h"

namespace cnerf::prepare {
namespace {

cv::Mat1b lines_at(double angle) {
  cv::Mat1b out(120, 160, std::uint8_t(128));
  for (int i = -10; i < 10; ++i) {
    const cv::Point2d across(std::cos(angle), std::sin(angle)), along(-across.y, across.x);
    const cv::Point2d at = cv::Point2d(80, 60) + across * (14.0 * i);
    cv::line(out, cv::Point(at - along * 300), cv::Point(at + along * 300), cv::Scalar(230), 2, cv::LINE_AA);
  }
  return out;
}

bool has(const std::vector<std::pair<int, int>>& pairs, int i, int j) {
  return std::ranges::binary_search(pairs, std::pair(i, j));
}

std::vector<LookVector> looks_of(int count) {
  std::vector<LookVector> looks;
  for (int i = 0; i < count; ++i) looks.push_back(look_of(lines_at(CV_PI * i / count)));
  return looks;
}

TEST(ImagePairs, LookDoesNotChangeWithExposure) {
  const LookVector bright = look_of(lines_at(0.3)), dark = look_of(cv::Mat1b(lines_at(0.3) * 0.5));
  const LookVector other = look_of(lines_at(1.4));
  float same = 0, different = 0;
  for (std::size_t i = 0; i < bright.size(); ++i) same += bright[i] * dark[i], different += bright[i] * other[i];
  EXPECT_GT(same, 0.98f);
  EXPECT_LT(different, 0.8f);
}

TEST(ImagePairs, NeighboursAndThoseAlikeAreMatchedOnce) {
  const std::vector<LookVector> looks = looks_of(40);  // half a turn of lines: image 39 resembles image 0 again
  const auto pairs = choose_pairs(looks, {2, 4});
  for (int i = 0; i + 2 < 40; ++i) EXPECT_TRUE(has(pairs, i, i + 1) && has(pairs, i, i + 2));
  EXPECT_TRUE(has(pairs, 0, 39)) << "the loop is closed by look";
  EXPECT_FALSE(has(choose_pairs(looks, {2, 0}), 0, 39)) << "and by nothing else";
  EXPECT_TRUE(std::ranges::is_sorted(pairs));
  EXPECT_TRUE(std::ranges::adjacent_find(pairs) == pairs.end());
  EXPECT_TRUE(std::ranges::all_of(pairs, [](const auto& p) { return p.first < p.second; }));
}

TEST(ImagePairs, EnoughNeighboursAreAllPairs) {
  EXPECT_EQ(choose_pairs(looks_of(12), {12, 0}).size(), 66u);
}

TEST(ColmapLog, TellsTheDoneShare) {
  EXPECT_EQ(share_in_log("", 10), 0);
  EXPECT_DOUBLE_EQ(share_in_log("Processed file [1/50]\n  Name: a\nProcessed file [12/50]\n  Name:", 50), 0.24);
  EXPECT_DOUBLE_EQ(share_in_log("Registering image #7 (3)\n\n  => x\nRegistering image #9 (20)\n", 50), 0.4);
  EXPECT_EQ(share_in_log("Processed file [", 50), 0);
  EXPECT_EQ(share_in_log("Registering image #7 (", 50), 0);
}

}  // namespace
}  // namespace cnerf::prepare
