#pragma once
/// Steps of the pipeline, as the studio's page sees them.

#include <functional>
#include <string>

#include "src/base/observer.h"
#include "src/base/usage.h"
#include "src/studio/board.h"

namespace cnerf::studio {

class BoardObserver final : public Observer {
 public:
  /// @param inner    hears all messages too
  /// @param between  is called between two pieces of the work; may throw Interrupted
  /// @param stops    whether somebody wants it to end
  BoardObserver(Board& board, Observer& inner, std::string task, std::function<void()> between,
                std::function<bool()> stops);

  void report_progress(const Progress& progress) override;
  void say(const std::string& text) override;
  [[nodiscard]] bool is_cancelled() const override { return stops_(); }

 private:
  Board& board_;
  Observer& inner_;
  std::string task_, step_;
  std::function<void()> between_;
  std::function<bool()> stops_;
  Stopwatch since_told_;
  bool has_told_ = false;
};

}  // namespace cnerf::studio
