#pragma once
/// What a running command shows in the browser, and what the browser asks of it. Thread-safe: the work publishes, the
/// server reads.

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "src/base/progress.h"

namespace cnerf::web {

/// A point of a curve.
struct CurvePoint {
  double seconds = 0;  ///< since the feed began
  double value = 0;
};

class LiveFeed {
 public:
  /// @param title  e.g. "train photos".
  explicit LiveFeed(std::string title);

  /// Notes where the work stands. Curves keep less than 500 points each: every other one
  /// goes when they are full.
  void progress(const Progress& progress);
  /// A picture, by name; an older one of that name goes. @param bytes  PNG or JPEG.
  void picture(const std::string& name, std::string bytes);
  /// A sentence; with `finished` the work is over and the buttons go.
  void say(const std::string& text, bool finished = false);

  void request_pause(bool paused);
  void request_stop();
  [[nodiscard]] bool stop_requested() const;
  /// Returns when nobody asks for a pause any more, or for a stop or Ctrl-C. @return seconds waited.
  double wait_while_paused();

  /// All there is, as JSON: title, task, fraction, paused, finished, message, curves, pictures.
  [[nodiscard]] std::string state() const;
  /// Waits up to `seconds` for another version than `after`. @return it and its state; nothing when there was none.
  [[nodiscard]] std::optional<std::pair<std::uint64_t, std::string>> wait_for_news(std::uint64_t after,
                                                                                   double seconds) const;
  [[nodiscard]] std::optional<std::string> picture(const std::string& name) const;
  /// Lets everything that waits go; no news come any more.
  void close();
  [[nodiscard]] bool closed() const;

 private:
  struct Curve {
    std::vector<CurvePoint> points;
    std::size_t every = 1, skipped = 0;  ///< of the reports
  };
  [[nodiscard]] std::string state_locked() const;
  void changed();

  std::string title_;
  double begin_;
  mutable std::mutex mutex_;
  mutable std::condition_variable news_;
  std::uint64_t version_ = 1;
  std::string task_, message_;
  double fraction_ = 0;
  std::vector<std::pair<std::string, double>> figures_;
  std::map<std::string, Curve> curves_;  ///< by "task: figure"
  std::map<std::string, std::pair<std::uint64_t, std::string>> pictures_;
  bool paused_ = false, stop_ = false, finished_ = false, closed_ = false;
};

}  // namespace cnerf::web
