#include "src/studio/board_observer.h"

#include <cmath>
#include <utility>

namespace cnerf::studio {
namespace {

constexpr double kBetweenReports = 0.1;  // seconds: steps may be thousands a second

}  // namespace

BoardObserver::BoardObserver(Board& board, Observer& inner, std::string task, std::function<void()> between,
                             std::function<bool()> stops)
    : board_(board), inner_(inner), task_(std::move(task)), between_(std::move(between)), stops_(std::move(stops)) {}

void BoardObserver::report_progress(const Progress& progress) {
  const bool is_new = !has_told_ || progress.task != step_;
  if (is_new || progress.fraction >= 1 || since_told_.seconds() >= kBetweenReports) {
    has_told_ = true;
    since_told_ = {};
    step_ = progress.task;
    board_.change([&](StateMessage& state) {
      state.task = task_;
      state.step = step_;
      state.fraction = progress.fraction;
      state.figures.clear();
      for (const auto& [name, value] : progress.figures) {
        if (std::isfinite(value)) state.figures[name] = value;
      }
    });
  }
  between_();
}

void BoardObserver::say(const std::string& text) {
  inner_.say(text);
  board_.note(text);
}

}  // namespace cnerf::studio
