#pragma once
/// How many steps a training takes: fewer where it stops gaining.

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace cnerf {

/// What a snapshot keeps of a pace.
struct PaceState {
  long falls_from = 0;          ///< the step from which the rate falls early; 0: it does not
  std::vector<double> windows;  ///< mean squared error of each that is over
  double sum = 0;               ///< of the errors since
  long count = 0;               ///< of steps since

  template <typename Self, typename Visitor>
  static void visit(Self& self, Visitor&& v) {
    v("falls_from", self.falls_from);
    v("windows", self.windows);
    v("sum", self.sum);
    v("count", self.count);
  }
};

/// Watches errors on pixels that a step is about to learn from. Most pixels are drawn once or a few times, so this is
/// close to a validation on pixels left out, and costs nothing (progressive validation, Blum et al. 1999).
///
/// While the learning rate is constant, errors are averaged over windows of a twentieth of all steps. Once two windows
/// on end gain less than asked, the rate begins to fall at once instead of after half of the steps, and falls for as
/// many steps as went before. Trainings of fewer than `kFewest` steps are left alone: their windows would tell little.
class TrainingPace {
 public:
  static constexpr long kFewest = 1000;

  TrainingPace() = default;
  /// @param most        steps
  /// @param least_gain  dB that a tenth of `most` has to bring; 0: never stops early
  TrainingPace(long most, double least_gain, PaceState state = {})
      : most_(most), window_(std::max(1L, most / 20)), least_gain_(least_gain), state_(std::move(state)) {}

  /// Of the whole training, as far as it is known by now.
  [[nodiscard]] long steps() const { return state_.falls_from > 0 ? std::min(most_, 2 * state_.falls_from) : most_; }
  [[nodiscard]] const PaceState& state() const { return state_; }

  /// @param step           that is done, counted from 1
  /// @param squared_error  mean over its rays
  /// @param mean           of a value over all ranks, which are asked together
  void after_step(long step, double squared_error, const std::function<double(double)>& mean) {
    if (least_gain_ <= 0 || most_ < kFewest || state_.falls_from > 0 || 2 * step >= most_) return;
    state_.sum += squared_error;
    ++state_.count;
    if (step % window_ != 0) return;
    state_.windows.push_back(mean(state_.sum / double(state_.count)));
    state_.sum = 0;
    state_.count = 0;
    const std::size_t n = state_.windows.size();
    if (n < 3) return;
    const double gain = 10 * std::log10(state_.windows[n - 3] / std::max(state_.windows[n - 1], 1e-12));
    if (gain < least_gain_) state_.falls_from = step;
  }

 private:
  long most_ = 0, window_ = 1;
  double least_gain_ = 0;
  PaceState state_;
};

}  // namespace cnerf
