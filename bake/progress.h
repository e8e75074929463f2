#pragma once
/// The share that one pass of a bake has in a progress line.

#include <string>
#include <utility>

#include "src/base/error.h"
#include "src/base/progress.h"

namespace cnerf::bake {

class PassProgress {
 public:
  /// @param task          of the line.  @param begin, end  of this pass on it, 0 to 1
  /// @param when_stopped  the message of Interrupted
  PassProgress(const ProgressSink& sink, std::string task, double begin, double end, std::string when_stopped)
      : sink_(sink), task_(std::move(task)), begin_(begin), end_(end), when_stopped_(std::move(when_stopped)) {}

  /// @param share  of the pass that is done.  @throws Interrupted  on Ctrl-C.
  void report(double share) const {
    if (interruption_requested()) throw Interrupted(when_stopped_);
    if (sink_) sink_({task_, begin_ + (end_ - begin_) * share, {}});
  }

 private:
  const ProgressSink& sink_;
  std::string task_;
  double begin_, end_;
  std::string when_stopped_;
};

/// Of the two passes over the planes of a volume bake.
inline constexpr double kDensityPassShare = 0.4;
[[nodiscard]] inline PassProgress volume_progress(const ProgressSink& sink, double begin, double end) {
  return {sink, "bake", begin, end, "bake stopped: the same command goes on from here"};
}

}  // namespace cnerf::bake
