#include "src/base/worker.h"

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace cnerf {
namespace {

TEST(Worker, DoesItsJobsInOrderOnOneThreadOfItsOwn) {
  Worker worker;
  std::vector<int> order;
  std::vector<std::future<std::thread::id>> threads;
  for (int i = 0; i < 100; ++i) {
    threads.push_back(worker.submit([&order, i] {
      order.push_back(i);
      return std::this_thread::get_id();
    }));
  }
  std::set<std::thread::id> seen;
  for (auto& thread : threads) seen.insert(thread.get());
  EXPECT_EQ(seen.size(), 1u);
  EXPECT_FALSE(seen.contains(std::this_thread::get_id()));
  for (int i = 0; i < 100; ++i) EXPECT_EQ(order[std::size_t(i)], i);
}

TEST(Worker, ErrorsArriveAndTheNextJobIsDone) {
  Worker worker;
  std::future<int> fails = worker.submit([]() -> int { throw std::domain_error("57"); });
  EXPECT_THROW((void)fails.get(), std::domain_error);
  EXPECT_EQ(worker.submit([] { return 58; }).get(), 58);
}

TEST(Worker, EndsOnceAllItsJobsAreDone) {
  int done = 0;
  std::promise<void> all_came;
  std::future<void> last;
  {
    Worker worker;
    std::future<void> first = worker.submit([&] {
      all_came.get_future().wait();
      ++done;
    });
    last = worker.submit([&] { ++done; });
    all_came.set_value();
  }
  EXPECT_EQ(done, 2);
  EXPECT_NO_THROW(last.get());
}

}  // namespace
}  // namespace cnerf
