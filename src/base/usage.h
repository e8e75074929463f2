#pragma once
/// Time and memory that the process has used.

#include <chrono>
#include <cstddef>
#include <string>

namespace cnerf {

/// Largest resident memory of the process so far, bytes.
[[nodiscard]] std::size_t peak_memory_bytes();
/// Resident memory of the process now, bytes; 0 where the system does not report it.
[[nodiscard]] std::size_t held_memory_bytes();

/// Lets allocations fail (std::bad_alloc) where the process would come to hold more than this; memory of a GPU and what
/// is reserved without being used do not count.
/// @param amount  as `bytes_from` reads it
/// @throws UsageError  naming `max_memory`, when the process holds more than that already
void limit_memory(const std::string& amount);

/// From now on the process may take so many bytes more than it has; an earlier limit stays where it is lower.
/// @return  whether this limit is the lower one
bool limit_growth(std::size_t bytes);

/// Measures seconds since its construction.
class Stopwatch {
 public:
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// The time of a training: a clock that stands still while an observer looks.
class TrainingClock {
 public:
  [[nodiscard]] double seconds() const { return watch_.seconds() - paused_; }
  template <typename Work>
  void pause_for(Work&& work) {
    const Stopwatch pause;
    work();
    paused_ += pause.seconds();
  }

 private:
  Stopwatch watch_;
  double paused_ = 0;
};

}  // namespace cnerf
