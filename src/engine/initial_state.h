#pragma once
/// How stage 1 starts: the same numbers on every device.

#include <cstdint>
#include <vector>

#include "encoding/hash_grid_levels.h"
#include "encoding/spherical_harmonics_math.h"
#include "src/field/density_activation.h"
#include "src/field/mlp_layout.h"

namespace cnerf {

// Streams of `initial_weights`.
inline constexpr std::uint64_t kDensityNetStream = 1, kLuminanceNetStream = 2;
inline constexpr int kLuminanceOutputs = 4;  ///< one, padded to what the CPU's kernels want

[[nodiscard]] inline MlpLayout density_net_layout(int levels) {
  return {{4 * levels, kHiddenWidth, kGeometryChannels}};
}
[[nodiscard]] inline MlpLayout luminance_net_layout() {
  return {{kGeometryChannels + kSphericalHarmonics, kHiddenWidth, kHiddenWidth, kLuminanceOutputs}};
}
/// Uniform in +-1e-4 (Mueller et al. 2022, Sec. 4).  [rows, 4]
[[nodiscard]] std::vector<float> initial_table(const std::vector<GridLevel>& levels, std::uint64_t seed);

}  // namespace cnerf
