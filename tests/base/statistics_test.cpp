#include "src/base/statistics.h"

#include <gtest/gtest.h>

namespace cnerf {
namespace {

TEST(Statistics, MedianOfOddAndEvenCounts) {
  EXPECT_EQ(median(std::vector{5.0, 1.0, 3.0}), 3.0);
  EXPECT_EQ(median(std::vector{4.0, 1.0, 3.0, 2.0}), 2.5);
  EXPECT_EQ(median(std::vector{7.0f}), 7.0f);
}

TEST(Statistics, QuantilesLieBetweenTheExtremes) {
  const std::vector<double> values = {30, 10, 20, 50, 40};
  EXPECT_EQ(quantile(values, 0), 10);
  EXPECT_EQ(quantile(values, 1), 50);
  EXPECT_EQ(quantile(values, 0.25), 20);
  EXPECT_DOUBLE_EQ(quantile(values, 0.9), 46);
  EXPECT_EQ(quantile(std::vector{2.0, 2.0, 2.0}, 0.3), 2.0) << "equal values stay exact";
}

TEST(Statistics, OfNothingIsABug) {
  EXPECT_THROW((void)median(std::vector<double>{}), ContractError);
}

}  // namespace
}  // namespace cnerf
