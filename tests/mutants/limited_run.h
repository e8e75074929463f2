#pragma once
/// A program run to its end under limits, and what became of it.

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/sanitizers.h"

namespace cnerf::mutants {

struct Limits {
  /// Without the time in which it was ready and others had the processors.
  std::chrono::seconds wall{test::kIsSanitized ? 300 : 30};
  std::size_t address_bytes = test::kIsSanitized ? 0 : std::size_t(12) << 30;  ///< 0 = none, as sanitizers need
  bool sanitized = test::kIsSanitized;                                         ///< the program is one of a sanitizer
};

struct Outcome {
  int exit_code = -1;
  int signal = 0;  ///< that ended it
  bool timed_out = false;
  std::size_t peak_bytes = 0;  ///< resident, the most of the program and of those it waited for
  double seconds = 0;
  std::string out, err;  ///< at most a MiB each
};

/// @param words  the program and its arguments; no shell
/// @param scratch  folder for its output; made if needed
/// @param interrupt_at  what the program prints before it is sent SIGINT; empty = it ends by itself
[[nodiscard]] Outcome run_limited(const std::vector<std::string>& words, const std::filesystem::path& scratch,
                                  const Limits& limits, const std::string& interrupt_at = "");

}  // namespace cnerf::mutants
