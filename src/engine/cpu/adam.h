#pragma once
/// Adam (Kingma and Ba 2015) as both kinds of parameters use it.

#include <cmath>

namespace cnerf {

struct AdamSettings {
  float beta1 = 0.9f;
  float beta2 = 0.99f;
  float epsilon = 1e-15f;  ///< tiny, because gradients of the hash table are (Mueller et al. 2022, Sec. 4)
};

/// Bias corrections of optimiser step `step` (counted from 1), folded into the step size and the second moment.
struct AdamStep {
  float step_size;
  float second_correction;

  AdamStep(const AdamSettings& settings, float learning_rate, long step)
      : step_size(static_cast<float>(learning_rate / (1.0 - std::pow(double(settings.beta1), double(step))))),
        second_correction(static_cast<float>(1.0 / (1.0 - std::pow(double(settings.beta2), double(step))))) {}
};

}  // namespace cnerf
