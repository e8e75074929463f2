#pragma once
/// Where the weights of stage 1's nets lie on the GPU: as floats for the optimiser, and packed in 16 bits in the order in
/// which lanes read the tensor cores' right operands.

#include <cstdint>

#include "encoding/spherical_harmonics_math.h"
#include "src/base/host_device.h"
#include "src/field/density_activation.h"

struct uint2;

namespace cnerf {

/// Place, in 16-bit numbers, of input k and output n of a packed layer with `outputs` outputs (tensor_core.cuh).
CNERF_HD constexpr int packed_place(int k, int n, int outputs) {
  const int tile = k / 16 * (outputs / 8) + n / 8;
  const int lane = n % 8 * 4 + k % 8 / 2;
  return (((tile * 32 + lane) * 2) + k % 16 / 8) * 2 + k % 2;
}

/// The nets' layers in the order of their floats. The luminance net's last layer has one output that counts; it stays in
/// floats.
enum class FieldLayer { kDensity1, kDensity2, kLuminance1, kLuminance2, kLuminance3 };

/// @tparam KT  encoded channels / 16, rounded up; the missing ones have weight 0
template <int KT>
struct FieldShape {
  static constexpr int kEncoded = 16 * KT;
  static constexpr int kFeatures = kGeometryChannels + kSphericalHarmonics;

  // Gradients of a block, [out, in] a layer.
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

/// One weight of the field: which layer, which output and input.
struct FieldWeight {
  FieldLayer layer;
  int out = 0, in = 0;
};
template <int KT>
CNERF_HD FieldWeight field_weight(int index) {
  using Shape = FieldShape<KT>;
  const auto within = [&](FieldLayer layer, int first, int inputs) {
    return FieldWeight{layer, (index - first) / inputs, (index - first) % inputs};
  };
  if (index >= Shape::kLuminance3) return within(FieldLayer::kLuminance3, Shape::kLuminance3, kHiddenWidth);
  if (index >= Shape::kLuminance2) return within(FieldLayer::kLuminance2, Shape::kLuminance2, kHiddenWidth);
  if (index >= Shape::kLuminance1) return within(FieldLayer::kLuminance1, Shape::kLuminance1, Shape::kFeatures);
  if (index >= Shape::kDensity2) return within(FieldLayer::kDensity2, Shape::kDensity2, kHiddenWidth);
  return within(FieldLayer::kDensity1, Shape::kDensity1, Shape::kEncoded);
}

/// What kernels read.
struct PackedField {
  const uint2* forward;     ///< [kPacked] halves
  const uint2* backward;    ///< [kPacked] bfloat16, transposed: inputs and outputs change places
  const float* last_layer;  ///< [64]
};

}  // namespace cnerf
