#pragma once
/// Adam (Kingma and Ba 2015) as both kinds of parameters use it, on every device.

#include <cmath>

#include "src/base/host_device.h"

namespace cnerf {

struct AdamSettings {
  float beta1 = 0.9f;
  float beta2 = 0.99f;
  float epsilon = 1e-15f;  ///< tiny, because gradients of the hash table are (Mueller et al. 2022, Sec. 4)
};

/// Bias corrections of optimiser step `step` (counted from 1), folded into the step size and the second moment.
struct AdamStep {
  float learning_rate = 0;
  float step_size = 0;
  float second_correction = 0;

  AdamStep() = default;
  CNERF_HD AdamStep(const AdamSettings& settings, float rate, long step)
      : learning_rate(rate),
        step_size(float(rate / (1.0 - std::pow(double(settings.beta1), double(step))))),
        second_correction(float(1.0 / (1.0 - std::pow(double(settings.beta2), double(step))))) {}

  /// Moves one parameter against its gradient `d`.
  CNERF_HD void apply(const AdamSettings& settings, float d, float& first_moment, float& second_moment,
                      float& parameter) const {
    first_moment = settings.beta1 * first_moment + (1 - settings.beta1) * d;
    second_moment = settings.beta2 * second_moment + (1 - settings.beta2) * d * d;
    parameter -= step_size * first_moment / (std::sqrt(second_moment * second_correction) + settings.epsilon);
  }
};

}  // namespace cnerf
