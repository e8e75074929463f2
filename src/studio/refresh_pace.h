#pragma once
/// When pages should draw what a work has changed so far: soon, and then a quarter of the time at most.

#include <algorithm>
#include <optional>

namespace cnerf::studio {

class RefreshPace {
 public:
  static constexpr double kBeforeFirst = 0.25, kLeastBetween = 1;  ///< seconds
  static constexpr double kLeastPerDrawn = 4;                      ///< seconds for each that was drawn

  /// Pages were drawn for so many seconds.
  void drew(double seconds) { drawn_ += seconds; }
  /// @param seconds  since the work began, those of drawing among them
  [[nodiscard]] bool is_due(double seconds) {
    const double pause = last_ ? std::max(kLeastBetween, kLeastPerDrawn * drawn_) : kBeforeFirst;
    if (seconds - last_.value_or(0) < pause) return false;
    last_ = seconds;
    drawn_ = 0;
    return true;
  }

 private:
  std::optional<double> last_;  // when it was due
  double drawn_ = 0;            // seconds since then
};

}  // namespace cnerf::studio
