#include "src/field/mlp_layout.h"

#include <cmath>

#include "src/base/rng.h"

namespace cnerf {

std::vector<float> initial_weights(const MlpLayout& layout, unsigned long long seed, unsigned long long stream) {
  SequentialRng rng(seed, stream);
  std::vector<float> weights;
  weights.reserve(layout.weight_count());
  for (int l = 0; l < layout.layers(); ++l) {
    const float bound = std::sqrt(6.0f / float(layout.widths[l]));
    for (int i = 0; i < layout.widths[l] * layout.widths[l + 1]; ++i) weights.push_back(rng.uniform(-bound, bound));
  }
  return weights;
}

}  // namespace cnerf
