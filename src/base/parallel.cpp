#include "src/base/parallel.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace cnerf {
namespace {

std::unique_ptr<tbb::global_control> thread_limit;  // NOLINT: TBB's own setting is global as well

/// `body(i)` for each i in [0, tasks), in any order, on any thread.
template <typename Body>
void run_tasks(std::size_t tasks, const Body& body) {
#ifdef __SANITIZE_THREAD__
  // TBB's library is not instrumented: the thread sanitizer would find races inside it, and could not see ours.
  std::atomic<std::size_t> next = 0;
  // A thread may have the identity of one that has ended, and with it what TBB keeps per thread: the C library makes
  // one wait for the other, which the sanitizer cannot see either.
  static std::atomic<std::size_t> ended = 0;
  const auto work = [&] {
    (void)ended.load(std::memory_order_acquire);
    for (std::size_t i = next++; i < tasks; i = next++) body(i);
    ended.fetch_add(1, std::memory_order_release);
  };
  std::vector<std::jthread> others;
  for (int t = 1; t < thread_count(); ++t) others.emplace_back(work);
  work();
#else
  // A thread that waits for the last tasks must not begin one of an outer loop: its caller may hold a lock, or memory.
  tbb::this_task_arena::isolate([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, tasks, 1),
        [&](const auto& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
        },
        tbb::simple_partitioner{});
  });
#endif
}

}  // namespace

void set_thread_count(int threads) {
  thread_limit.reset();
  if (threads > 0) {
    thread_limit =
        std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
  }
}

int thread_count() {
  return int(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

void parallel_tasks(std::size_t tasks, const std::function<void(std::size_t)>& task) {
  // Of several failing tasks the first by number is reported, so that errors do not depend on timing either.
  std::mutex mutex;
  std::exception_ptr failure;
  std::atomic<std::size_t> failed = tasks;
  run_tasks(tasks, [&](std::size_t i) {
    if (i >= failed) return;
    try {
      task(i);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (i < failed) {
        failed = i;
        failure = std::current_exception();
      }
    }
  });
  if (failure) std::rethrow_exception(failure);
}

void parallel_ranges(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& body) {
  const std::size_t pieces = (count + grain - 1) / grain;
  parallel_tasks(pieces, [&](std::size_t i) { body(i * grain, std::min(count, (i + 1) * grain)); });
}

}  // namespace cnerf
