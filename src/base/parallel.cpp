#include "src/base/parallel.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>
#include <mutex>

namespace cnerf {
namespace {

std::unique_ptr<tbb::global_control> thread_limit;  // NOLINT: TBB's own setting is global as well

/// Tells the thread sanitizer what a loop guarantees: all before it happens before its tasks, and these before all after
/// it. TBB's library is not instrumented, so that the sanitizer does not see how it is done.
class LoopOrder {
#ifdef __SANITIZE_THREAD__
 public:
  LoopOrder() { pass(); }
  void pass() { passes_.fetch_add(1, std::memory_order_acq_rel); }

 private:
  std::atomic<std::size_t> passes_ = 0;
#else
 public:
  void pass() {}
#endif
};

}  // namespace

void set_thread_count(int threads) {
  thread_limit.reset();
  if (threads > 0) {
    thread_limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                         static_cast<std::size_t>(threads));
  }
}

int thread_count() {
  return static_cast<int>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

void parallel_tasks(std::size_t tasks, const std::function<void(std::size_t)>& task) {
  // Of several failing tasks the first by number is reported, so that errors do not depend on timing either.
  std::mutex mutex;
  std::exception_ptr failure;
  std::atomic<std::size_t> failed = tasks;
  LoopOrder order;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, tasks, 1),
      [&](const auto& range) {
        order.pass();
        for (std::size_t i = range.begin(); i != range.end() && i < failed; ++i) {
          try {
            task(i);
          } catch (...) {
            const std::lock_guard lock(mutex);
            if (i < failed) {
              failed = i;
              failure = std::current_exception();
            }
          }
        }
        order.pass();
      },
      tbb::simple_partitioner{});
  order.pass();
  if (failure) std::rethrow_exception(failure);
}

void parallel_ranges(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& body) {
  const std::size_t pieces = (count + grain - 1) / grain;
  parallel_tasks(pieces, [&](std::size_t i) { body(i * grain, std::min(count, (i + 1) * grain)); });
}

}  // namespace cnerf
