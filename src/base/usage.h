#pragma once
/// What the process has used so far.

#include <chrono>
#include <cstddef>

namespace cnerf {

/// The most memory the process ever held resident, bytes.
[[nodiscard]] std::size_t peak_memory_bytes();
/// Memory it holds resident now, bytes; 0 where the system does not tell.
[[nodiscard]] std::size_t held_memory_bytes();

/// Seconds since it was made.
class Stopwatch {
 public:
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace cnerf
