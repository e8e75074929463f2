#pragma once
/// A channel between threads of one process: each thread plays a rank.

#include <chrono>
#include <condition_variable>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "src/cluster/ranks.h"

namespace cnerf::test {

/// What all stores and groups of one test share.
struct Exchange {
  std::mutex mutex;
  std::condition_variable changed;
  std::map<std::string, cluster::Bytes> values;
  std::map<std::string, std::int64_t> counts;
  bool is_silent = false;  ///< the network: every call waits then
  bool is_broken = false;  ///< every call throws
  // Of the operation that all ranks are in.
  std::vector<double> sums;
  int entered = 0;
  std::int64_t round = 0;

  /// Waits while the network is silent.
  std::unique_lock<std::mutex> entered_lock() {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return !is_silent; });
    if (is_broken) throw std::runtime_error("connection reset");
    return lock;
  }
  void change(bool& flag, bool value) {
    const std::lock_guard lock(mutex);
    flag = value;
    changed.notify_all();
  }
};

/// Of the test that runs; a Channel consists of plain functions.
inline std::shared_ptr<Exchange> exchange;

class FakeStore final : public cluster::Store {
 public:
  void set(const std::string& key, const cluster::Bytes& value) override {
    const auto lock = shared_->entered_lock();
    if (value.size() > cluster::kLargestValue) throw std::runtime_error("connection reset");
    shared_->values[key] = value;
  }
  std::optional<cluster::Bytes> get(const std::string& key) override {
    const auto lock = shared_->entered_lock();
    const auto found = shared_->values.find(key);
    if (found == shared_->values.end()) return std::nullopt;
    return found->second;
  }
  std::int64_t add(const std::string& key, std::int64_t amount) override {
    const auto lock = shared_->entered_lock();
    return shared_->counts[key] += amount;
  }
  void remove(const std::string& key) override {
    const auto lock = shared_->entered_lock();
    shared_->values.erase(key);
  }

 private:
  std::shared_ptr<Exchange> shared_ = exchange;
};

class FakeGroup final : public cluster::Group {
 public:
  explicit FakeGroup(int rank, int size) : rank_(rank), size_(size) {}
  void sum(std::span<float> values) override { sum_of(values); }
  void sum(std::span<double> values) override { sum_of(values); }
  void broadcast(std::span<std::byte> bytes, int from) override {
    std::vector<double> values(bytes.size());
    for (std::size_t i = 0; i < bytes.size() && rank_ == from; ++i) values[i] = double(int(bytes[i]));
    sum_of(std::span(values));
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = std::byte(int(values[i]));
  }

 private:
  /// Ranks add in the order of their numbers, so that the sum is always the same.
  template <typename Value>
  void sum_of(std::span<Value> values) {
    std::unique_lock lock(shared_->mutex);
    const std::int64_t round = shared_->round;
    shared_->changed.wait(lock, [&] { return shared_->entered == rank_ || shared_->is_broken; });
    if (shared_->is_broken) throw std::runtime_error("connection reset");
    if (rank_ == 0) shared_->sums.assign(values.size(), 0.0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      shared_->sums[i] = double(Value(shared_->sums[i]) + values[i]);
    }
    shared_->entered += 1;
    shared_->changed.notify_all();
    shared_->changed.wait(lock, [&] { return shared_->entered >= size_ || shared_->round > round; });
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = Value(shared_->sums[i]);
    // The last one to read opens the next round.
    if (++shared_->entered == 2 * size_) {
      shared_->entered = 0;
      shared_->round += 1;
      shared_->changed.notify_all();
    }
    shared_->changed.wait(lock, [&] { return shared_->round > round; });
  }

  std::shared_ptr<Exchange> shared_ = exchange;
  int rank_, size_;
};

inline const cluster::Channel& fake_channel() {
  static const cluster::Channel channel{
      [](const cluster::Launch&, bool, cluster::Seconds) -> std::unique_ptr<cluster::Store> {
        return std::make_unique<FakeStore>();
      },
      [](const cluster::Launch& launch, cluster::Seconds) -> std::unique_ptr<cluster::Group> {
        return std::make_unique<FakeGroup>(launch.rank, launch.size);
      },
      "threads"};
  return channel;
}

inline cluster::Meeting fake_meeting(int rank, int size) {
  cluster::Launch launch;
  launch.launcher = "a test";
  launch.rank = rank;
  launch.size = size;
  return {
      launch, fake_channel(), {}, cluster::Seconds(20), "thread " + std::to_string(rank), [](const std::string&) {}};
}

/// Runs `work(ranks)` on so many threads, each a rank, and lets them leave. Rethrows the error of the lowest rank.
template <typename Work>
void on_ranks(int size, const Work& work) {
  exchange = std::make_shared<Exchange>();
  std::vector<std::exception_ptr> errors(static_cast<std::size_t>(size));
  std::vector<std::jthread> threads;
  for (int rank = 0; rank < size; ++rank) {
    threads.emplace_back([&, rank] {
      try {
        cluster::JoinedRanks ranks(fake_meeting(rank, size));
        try {
          work(ranks);
          ranks.leave({});
        } catch (const std::exception& error) {
          ranks.leave(error.what());
          throw;
        }
      } catch (...) {
        errors[std::size_t(rank)] = std::current_exception();
      }
    });
  }
  threads.clear();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace cnerf::test
