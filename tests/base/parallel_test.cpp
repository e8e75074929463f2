#include "src/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace cnerf {
namespace {

class Parallel : public testing::TestWithParam<int> {
 protected:
  void SetUp() override { set_thread_count(GetParam()); }
  void TearDown() override { set_thread_count(0); }
};

TEST_P(Parallel, EveryTaskRunsOnce) {
  std::vector<std::atomic<int>> calls(1000);
  parallel_tasks(calls.size(), [&](std::size_t i) { ++calls[i]; });
  for (const auto& count : calls) EXPECT_EQ(count, 1);
}

TEST_P(Parallel, RangesCoverAllWithoutOverlap) {
  for (const std::size_t count : {0u, 1u, 63u, 64u, 65u, 1000u}) {
    std::vector<std::atomic<int>> calls(count);
    parallel_ranges(count, 64, [&](std::size_t begin, std::size_t end) {
      EXPECT_LE(end - begin, 64u);
      EXPECT_EQ(begin % 64, 0u);
      for (std::size_t i = begin; i < end; ++i) ++calls[i];
    });
    for (const auto& number : calls) EXPECT_EQ(number, 1) << count;
  }
}

TEST_P(Parallel, ExceptionOfATaskArrives) {
  EXPECT_THROW(parallel_tasks(100,
                              [](std::size_t i) {
                                if (i == 57) throw std::domain_error("57");
                              }),
               std::domain_error);
}

TEST_P(Parallel, NoTasksIsFine) {
  parallel_tasks(0, [](std::size_t) { FAIL(); });
}

TEST_P(Parallel, NestedLoopsFinish) {
  std::atomic<int> sum = 0;
  parallel_tasks(8, [&](std::size_t) { parallel_tasks(8, [&](std::size_t) { ++sum; }); });
  EXPECT_EQ(sum, 64);
}

TEST_P(Parallel, ThreadCountIsWhatWasSet) {
  EXPECT_EQ(thread_count(), GetParam());
}

INSTANTIATE_TEST_SUITE_P(Threads, Parallel, testing::Values(1, 2, 4));

TEST(ParallelDefault, ZeroRestoresAllCores) {
  const int before = thread_count();
  set_thread_count(before + 3);
  EXPECT_EQ(thread_count(), before + 3);
  set_thread_count(0);
  EXPECT_EQ(thread_count(), before);
}

}  // namespace
}  // namespace cnerf
