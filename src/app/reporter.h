#pragma once
/// What the user sees while a command runs and when it ends.

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

#include "src/base/observer.h"

namespace cnerf::app {

enum class ProgressStyle {
  kLine,    ///< one line that rewrites itself, for a terminal
  kPlain,   ///< a line now and then, for a log
  kJson,    ///< one JSON object a line, for programs: {"event": "progress" | "message" | "wrote" | "next", ...}
  kQuiet,   ///< results only
  kSilent,  ///< nothing at all
};

/// Of "auto", "line", "plain", "json", "quiet"; "auto" looks at whether `out` is a terminal.  @throws UsageError.
[[nodiscard]] ProgressStyle progress_style(const std::string& name, std::FILE* out);

class Reporter : public Observer {
 public:
  explicit Reporter(ProgressStyle style, std::FILE* out = stdout) : style_(style), out_(out) {}

  void report_progress(const Progress& progress) override;
  void say(const std::string& text) override;
  void wrote(const std::string& what, const std::filesystem::path& path) override;
  /// What the user may want to do now.
  void next(const std::string& text);

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] double remaining_seconds(const Progress& progress) const;
  void print_progress(const Progress& progress, double remaining);
  void print_line(const std::string& line);
  void end_line();

  ProgressStyle style_;
  std::FILE* out_;
  std::string task_;           ///< that reported last
  Clock::time_point start_;    ///< of the task
  double start_fraction_ = 0;  ///< a resumed task does not start at 0
  Clock::time_point last_shown_;
  bool line_open_ = false;  ///< a rewriting line waits for its end
};

}  // namespace cnerf::app
