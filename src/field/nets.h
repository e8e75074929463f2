#pragma once
/// Shapes and initial values of the fields' nets and tables, the same numbers on every device.

#include <cstdint>
#include <vector>

#include "encoding/hash_grid_levels.h"
#include "encoding/spherical_harmonics_math.h"
#include "src/color/ab_bins.h"
#include "src/field/mlp_layout.h"

namespace cnerf {

inline constexpr int kGeometryChannels = 16;  ///< outputs of the density net; the first one is log density
inline constexpr int kHiddenWidth = 64;

// Streams of `initial_weights`.
inline constexpr std::uint64_t kDensityNetStream = 1, kLuminanceNetStream = 2, kPointNetStream = 3,
                               kChromaHeadStream = 4;
inline constexpr std::uint64_t kTableStream = 2469;  ///< of `initial_table`
inline constexpr int kLuminanceOutputs = 4;          ///< one, padded to the block size of the CPU's kernels

/// The nets of stage 1's field.
[[nodiscard]] inline MlpLayout density_net_layout(int levels) {
  return {{4 * levels, kHiddenWidth, kGeometryChannels}};
}
[[nodiscard]] inline MlpLayout luminance_net_layout() {
  return {{kGeometryChannels + kSphericalHarmonics, kHiddenWidth, kHiddenWidth, kLuminanceOutputs}};
}

/// The nets of stage 2's fields.
[[nodiscard]] inline MlpLayout point_net_layout(int levels, int outputs) {
  return {{4 * levels, kHiddenWidth, outputs}};
}
inline constexpr int kChromaFeatures = 64;                     ///< hidden features per sample
inline constexpr int kChromaHeadInputs = kChromaFeatures + 4;  ///< features, the bias's constant 1, padding
inline constexpr int kChromaHeadOutputs = kAbBinCount + 3;     ///< padded to a multiple of 4
inline constexpr int kChromaticityOutputs = 4;                 ///< log x, log z, padding
/// [kChromaHeadOutputs, kChromaHeadInputs]; small, so that the first distribution is nearly uniform.
[[nodiscard]] std::vector<float> initial_chroma_head(std::uint64_t seed);

/// Uniform in +-1e-4 (Mueller et al. 2022, Sec. 4).  [rows, 4]
[[nodiscard]] std::vector<float> initial_table(const std::vector<GridLevel>& levels, std::uint64_t seed);

}  // namespace cnerf
