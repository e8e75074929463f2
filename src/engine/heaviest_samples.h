#pragma once
/// Leaves out the samples of a ray that weigh next to nothing.

#include <algorithm>
#include <cstddef>
#include <functional>
#include <numeric>
#include <vector>

#include "src/engine/luminance_engine.h"

namespace cnerf {

/// Keeps, of each ray, the fewest samples that carry `effort.shaded_share` of its weight, in order, and scales their
/// weights up to the ray's opacity. A ray that ended early counts as opaque.
/// @tparam Sample  has a member `weight`, >= 0
/// @param offsets  [rays + 1], where rays begin in `samples`; changed with them
template <typename Sample>
void keep_heaviest(const RenderEffort& effort, std::vector<Sample>& samples, std::vector<std::size_t>& offsets) {
  std::vector<float> weights;
  std::size_t write = 0;
  for (std::size_t r = 0; r + 1 < offsets.size(); ++r) {
    const std::size_t begin = offsets[r], end = offsets[r + 1];
    weights.clear();
    for (std::size_t s = begin; s < end; ++s) weights.push_back(samples[s].weight);
    const float total = std::accumulate(weights.begin(), weights.end(), 0.0f);
    float lightest = 0, carried = 0;
    if (effort.shaded_share < 1) {
      std::sort(weights.begin(), weights.end(), std::greater<>());
      for (std::size_t i = 0; i < weights.size() && carried < effort.shaded_share * total; ++i) {
        carried += lightest = weights[i];
      }
    }

    offsets[r] = write;
    float kept = 0;
    for (std::size_t s = begin; s < end; ++s) {
      if (samples[s].weight < lightest || (samples[s].weight <= 0 && effort.shaded_share < 1)) continue;
      kept += samples[s].weight;
      samples[write++] = samples[s];
    }
    const float scale = kept > 0 ? effort.opacity_of(total) / kept : 1.0f;
    for (std::size_t s = offsets[r]; s < write; ++s) samples[s].weight *= scale;
  }
  if (!offsets.empty()) offsets.back() = write;
  samples.resize(write);
}

}  // namespace cnerf
