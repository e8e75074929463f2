#include "src/base/rng.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>

namespace cnerf {
namespace {

constexpr int kDraws = 200'000;

TEST(CounterRng, IsAPureFunctionOfSeedStreamAndIndex) {
  const CounterRng a(7, 3);
  const CounterRng b(7, 3);
  EXPECT_EQ(a.bits(41), b.bits(41));
  EXPECT_NE(a.bits(41), a.bits(42));
  EXPECT_NE(a.bits(41), CounterRng(8, 3).bits(41));
  EXPECT_NE(a.bits(41), CounterRng(7, 4).bits(41));
}

TEST(CounterRng, MixesAsSplitMix64) {
  // First outputs of SplitMix64 from state 0, whose n-th state is n times the increment.
  EXPECT_EQ(mix_bits(0), 0xe220a8397b1dcdafull);
  EXPECT_EQ(mix_bits(0x9e3779b97f4a7c15ull), 0x6e789e6aa1b965f4ull);
}

TEST(CounterRng, NamedStreamsAreTheLettersOfTheirNames) {
  static_assert(named_stream("A") == 65);
  static_assert(named_stream("AB") == 65 * 256 + 66);
  static_assert(named_stream("A\0") == 65 * 256);
  EXPECT_NE(named_stream("known"), named_stream("pixel"));
}

TEST(CounterRng, SeedAndStreamAreNotInterchangeable) {
  EXPECT_NE(CounterRng(1, 2).key, CounterRng(2, 1).key);
}

TEST(CounterRng, UniformFillsTheUnitInterval) {
  const CounterRng rng(1, 2);
  std::array<int, 20> bins{};
  for (int i = 0; i < kDraws; ++i) {
    const float u = rng.uniform(std::uint64_t(i));
    ASSERT_GE(u, 0.0f);
    ASSERT_LT(u, 1.0f);
    ++bins[std::size_t(u * 20)];
  }
  // Chi-squared with 19 degrees of freedom: 43.8 is the 99.9 % quantile.
  const double expected = kDraws / 20.0;
  double chi_squared = 0;
  for (const int count : bins) chi_squared += (count - expected) * (count - expected) / expected;
  EXPECT_LT(chi_squared, 43.8);
  EXPECT_GT(chi_squared, 4.0);  // nor suspiciously even
}

TEST(CounterRng, NeighbouringIndicesAndStreamsAreUncorrelated) {
  double by_index = 0;
  double by_stream = 0;
  for (int i = 0; i < kDraws; ++i) {
    const auto index = std::uint64_t(i);
    const double u = CounterRng(5, 0).uniform(index) - 0.5;
    by_index += u * (CounterRng(5, 0).uniform(index + 1) - 0.5);
    by_stream += u * (CounterRng(5, 1).uniform(index) - 0.5);
  }
  // The variance of a product is 1/144; 4 standard deviations.
  const double limit = 4 * std::sqrt(kDraws / 144.0);
  EXPECT_LT(std::abs(by_index), limit);
  EXPECT_LT(std::abs(by_stream), limit);
}

TEST(CounterRng, BelowReachesEveryValueAndNoOther) {
  const CounterRng rng(3, 3);
  std::set<std::uint32_t> seen;
  for (std::uint64_t i = 0; i < 1000; ++i) seen.insert(rng.below(i, 7));
  EXPECT_EQ(seen, (std::set<std::uint32_t>{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(rng.below(0, 1), 0u);
}

TEST(SequentialRng, DrawsTheCountersInOrder) {
  SequentialRng sequence(9, 1);
  const CounterRng counter(9, 1);
  EXPECT_EQ(sequence.uniform(), counter.uniform(0));
  EXPECT_EQ(sequence.uniform(), counter.uniform(1));
  EXPECT_EQ(sequence.below(10), counter.below(2, 10));
}

TEST(SequentialRng, NormalHasItsMoments) {
  SequentialRng rng(4, 4);
  double sum = 0;
  double squares = 0;
  double fourth = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double v = rng.normal();
    ASSERT_TRUE(std::isfinite(v));
    sum += v;
    squares += v * v;
    fourth += v * v * v * v;
  }
  EXPECT_NEAR(sum / kDraws, 0, 4 / std::sqrt(double(kDraws)));
  EXPECT_NEAR(squares / kDraws, 1, 4 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(fourth / kDraws, 3, 4 * std::sqrt(96.0 / kDraws));
}

}  // namespace
}  // namespace cnerf
