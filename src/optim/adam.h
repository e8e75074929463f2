#pragma once
/// Adam (Kingma and Ba 2015), once for every device and for both kinds of parameters: weights of nets and rows of hash
/// grids.

#include <algorithm>
#include <cmath>

#include "src/base/host_device.h"

namespace cnerf {

inline constexpr float kAdamBeta1 = 0.9f;
inline constexpr float kAdamBeta2 = 0.99f;
/// Tiny, because gradients of the hash table are (Mueller et al. 2022, Sec. 4).
inline constexpr float kAdamEpsilon = 1e-15f;

/// Bias corrections of optimiser step `step` (counted from 1), folded into the step size and the second moment.
struct AdamStep {
  float learning_rate = 0;
  float step_size = 0;
  float second_correction = 0;

  AdamStep() = default;
  CNERF_HD AdamStep(float rate, long step)
      : learning_rate(rate),
        step_size(float(rate / (1.0 - std::pow(double(kAdamBeta1), double(step))))),
        second_correction(float(1.0 / (1.0 - std::pow(double(kAdamBeta2), double(step))))) {}

  /// The same step for parameters that learn faster or slower.
  [[nodiscard]] CNERF_HD AdamStep at_rate(float share) const {
    AdamStep step = *this;
    step.learning_rate *= share;
    step.step_size *= share;
    return step;
  }
  /// The factor that decoupled weight decay applies to a parameter.  @param decay  in units of the learning rate
  [[nodiscard]] CNERF_HD float kept(float decay) const { return 1 - learning_rate * decay; }

  /// Updates one parameter by its gradient `d`.
  /// @param kept  factor of weight decay; 1 without
  CNERF_HD void apply(float d, float& first_moment, float& second_moment, float& parameter, float kept = 1) const {
    first_moment = kAdamBeta1 * first_moment + (1 - kAdamBeta1) * d;
    second_moment = kAdamBeta2 * second_moment + (1 - kAdamBeta2) * d * d;
    parameter =
        kept * parameter - step_size * first_moment / (std::sqrt(second_moment * second_correction) + kAdamEpsilon);
  }
};

/// A step size that is constant for the first half of a training and then falls exponentially.
/// @param fraction  of the training that is done
[[nodiscard]] inline float decayed_rate(double from, double to, double fraction) {
  return float(from * std::pow(to / from, std::clamp(2.0 * fraction - 1.0, 0.0, 1.0)));
}

}  // namespace cnerf
