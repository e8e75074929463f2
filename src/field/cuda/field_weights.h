#pragma once
/// The memory layout of the weights of stage 1's nets on the GPU, layer by layer (dense_layer.h). The luminance net's
/// last layer has a single real output and stays in floats.

#include <cstdint>

#include "encoding/hash_grid_levels.h"
#include "encoding/spherical_harmonics_math.h"
#include "src/field/cuda/dense_layer.h"
#include "src/field/luminance_activation.h"
#include "src/field/nets.h"

namespace cnerf {

/// @tparam KT  encoded channels / 16, rounded up; the missing ones have weight 0
template <int KT>
struct FieldShape {
  static constexpr int kEncoded = 16 * KT;
  static constexpr int kFeatures = kGeometryChannels + kSphericalHarmonics;

  // Gradients of a block, [out, in] per layer.
  static constexpr int kDensity1 = 0;
  static constexpr int kDensity2 = kDensity1 + kHiddenWidth * kEncoded;
  static constexpr int kLuminance1 = kDensity2 + kGeometryChannels * kHiddenWidth;
  static constexpr int kLuminance2 = kLuminance1 + kHiddenWidth * kFeatures;
  static constexpr int kLuminance3 = kLuminance2 + kHiddenWidth * kHiddenWidth;
  static constexpr int kWeights = kLuminance3 + kHiddenWidth;

  // Packed right operands, in uint2 (one lane's share of 16 x 8 weights); every weight but the last layer's.
  static constexpr int kPacked = kLuminance3 / 4;
  static constexpr int kPackedDensity1 = kDensity1 / 4;
  static constexpr int kPackedDensity2 = kDensity2 / 4;
  static constexpr int kPackedLuminance1 = kLuminance1 / 4;
  static constexpr int kPackedLuminance2 = kLuminance2 / 4;
};

/// Encoded direction of a ray, its part of the luminance net's input: 16 halves, two per word.
struct alignas(16) DirectionCode {
  std::uint32_t pair[kSphericalHarmonics / 2];
};

/// What kernels read.
struct PackedField {
  PackedWeights weights;    ///< [kPacked]
  const float* last_layer;  ///< [64]
};

/// The field as kernels see it.
struct FieldView {
  const GridLevel* levels = nullptr;  ///< host memory, [n_levels]
  int n_levels = 0;
  const uint2* table = nullptr;  ///< [rows, 4] halves
  PackedField nets{};
  float density_scale = 1;
  LuminanceActivation<float> activation{};
};

}  // namespace cnerf
