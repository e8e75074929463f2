#pragma once
/// Worker: one thread that does jobs in turn.

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>
#include <type_traits>
#include <utility>

namespace cnerf {

/// Does its jobs on the same thread, in the order in which they came. For libraries that keep what they prepared per
/// thread, as cuDNN its plans for a convolution: with a thread for each job they would prepare it anew.
class Worker {
 public:
  /// What the job returns or throws arrives by the future. A worker ends once all its jobs are done.
  template <typename Job>
  [[nodiscard]] std::future<std::invoke_result_t<Job>> submit(Job job) {
    const auto task = std::make_shared<std::packaged_task<std::invoke_result_t<Job>()>>(std::move(job));
    {
      const std::lock_guard lock(mutex_);
      jobs_.emplace_back([task] { (*task)(); });
    }
    waiting_.notify_one();
    return task->get_future();
  }

 private:
  void work(const std::stop_token& stop) {
    while (true) {
      std::function<void()> job;
      {
        std::unique_lock lock(mutex_);
        if (!waiting_.wait(lock, stop, [this] { return !jobs_.empty(); })) return;
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
      job();
    }
  }

  std::mutex mutex_;
  std::condition_variable_any waiting_;
  std::deque<std::function<void()>> jobs_;
  std::jthread thread_{[this](const std::stop_token& stop) { work(stop); }};  // last: begins when all else is there
};

}  // namespace cnerf
