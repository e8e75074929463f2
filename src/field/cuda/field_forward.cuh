#pragma once
/// Stage 1's field for 32 samples of a warp, one per lane: hash grid, density net, luminance net.

#include "encoding/cuda/hash_grid_device.cuh"
#include "src/base/vec3.h"
#include "src/field/cuda/field_weights.h"
#include "src/field/cuda/tensor_core.cuh"

namespace cnerf {

/// What this lane holds of a left operand all of whose rows are this direction.
__device__ inline uint2 share_of_lane(const DirectionCode& direction) {
  return make_uint2(direction.pair[threadIdx.x % 4], direction.pair[threadIdx.x % 4 + 4]);
}
__device__ inline DirectionCode encode_direction(Vec3f direction) {
  float value[kSphericalHarmonics];
  spherical_harmonics(direction.x, direction.y, direction.z, [&](int i, float v) { value[i] = v; });
  DirectionCode code;
#pragma unroll
  for (int i = 0; i < kSphericalHarmonics / 2; ++i) code.pair[i] = Half::pack(value[2 * i], value[2 * i + 1]);
  return code;
}

/// A point as the hash grid takes it.
__device__ inline Vec3f in_box(Vec3f p) {
  return {__saturatef(p.x), __saturatef(p.y), __saturatef(p.z)};
}

/// What a warp works on: 32 samples in two tiles of 16.
inline constexpr int kWarpTiles = 2;

/// Encoded positions of a warp's samples, in shared memory.
template <int KT>
struct WarpEncoding {
  static constexpr int kStride = 16 * KT + 8;  // padded: rows of 8 fall into different banks
  alignas(16) __half encoded[32][kStride];     ///< a row per sample; channels behind the last level's must be zero

  __device__ void clear(unsigned lane) {
    for (int c = 0; c < kStride; ++c) encoded[lane][c] = __half(0.0f);
    __syncwarp();
  }
  /// Writes this lane's row.
  __device__ void encode(const GridLevels& levels, const uint2* table, Vec3f p, unsigned lane) {
    const float position[3] = {p.x, p.y, p.z};
    auto* row = reinterpret_cast<uint2*>(encoded[lane]);
#pragma unroll 2
    for (int l = 0; l < levels.count; ++l) row[l] = gather(levels.level[l], table, position);
  }
  /// Copies the first `count` rows to [.., 16 KT] halves, whole rows at a time; `room` rows fit.
  __device__ void store(uint4* to, unsigned count, unsigned room, unsigned lane) const {
    constexpr unsigned kParts = 2 * KT;  // 16 bytes each
    for (unsigned part = lane; part < min(count, room) * kParts; part += 32) {
      to[part] = reinterpret_cast<const uint4*>(encoded[part / kParts])[part % kParts];
    }
  }
  /// ReLU of a first layer of 64 outputs, as left operands. The whole warp calls it, after `__syncwarp`.
  __device__ void hidden_layer(const uint2* weights, std::uint32_t (&hidden)[kWarpTiles][4][4]) const {
    const unsigned lane = threadIdx.x % 32;
    std::uint32_t operands[kWarpTiles][KT][4];
#pragma unroll
    for (int m = 0; m < kWarpTiles; ++m) {
#pragma unroll
      for (int k = 0; k < KT; ++k) {
        load_operand(operands[m][k], &encoded[16 * m + lane % 16][16 * k + 8 * (lane / 16)]);
      }
    }
    dense<Half, kWarpTiles, KT, 4>(
        operands, weights, [&](int m, int n, const float(&sums)[2][4]) { pack_relu<Half>(sums, hidden[m][n]); });
  }
};

/// Shared memory of one warp.
template <int KT>
struct WarpField : WarpEncoding<KT> {
  alignas(16) __half direction[32][kSphericalHarmonics + 8];
  float density[32], luminance[32];

  /// Writes this lane's direction, where every sample has its own.
  __device__ void set_direction(Vec3f d, unsigned lane) {
    const DirectionCode code = encode_direction(d);
    auto* row = reinterpret_cast<std::uint32_t*>(direction[lane]);
#pragma unroll
    for (int i = 0; i < kSphericalHarmonics / 2; ++i) row[i] = code.pair[i];
  }
};

/// The nets, weights in shared memory. The whole warp calls the functions together, after `__syncwarp`.
template <int KT>
class FieldNets {
 public:
  using Shape = FieldShape<KT>;
  static constexpr int kTiles = kWarpTiles;

  __device__ FieldNets(const uint2* weights, const float* last_layer) : weights_(weights), last_(last_layer) {}

  /// What the luminance net needs of the density net: its outputs as left operands.
  struct Geometry {
    std::uint32_t channels[kTiles][4];
  };

  /// Raw log density of this lane's sample.
  __device__ float density(WarpField<KT>& warp, Geometry& geometry) const {
    const unsigned lane = threadIdx.x % 32, g = lane / 4, t = lane % 4;
    std::uint32_t hidden[kTiles][4][4];
    warp.hidden_layer(weights_ + Shape::kPackedDensity1, hidden);
    dense<Half, kTiles, 4, 1>(hidden, weights_ + Shape::kPackedDensity2, [&](int m, int, const float(&sums)[2][4]) {
      if (t == 0) {
        warp.density[16 * m + g] = sums[0][0];
        warp.density[16 * m + g + 8] = sums[0][2];
      }
      pack_operand<Half>(sums, geometry.channels[m]);
    });
    __syncwarp();
    return warp.density[lane];
  }
  /// The luminance net's raw output for this lane's sample.
  /// @param directions  [tiles] share_of_lane of the direction all samples of a tile have; null: each sample has its
  ///                    own in `warp.direction`
  __device__ float luminance(WarpField<KT>& warp, const Geometry& geometry, const uint2* directions) const {
    const unsigned lane = threadIdx.x % 32;
    std::uint32_t features[kTiles][2][4];
#pragma unroll
    for (int m = 0; m < kTiles; ++m) {
#pragma unroll
      for (int r = 0; r < 4; ++r) features[m][0][r] = geometry.channels[m][r];
      if (directions != nullptr) {
        features[m][1][0] = features[m][1][1] = directions[m].x;
        features[m][1][2] = features[m][1][3] = directions[m].y;
      } else {
        load_operand(features[m][1], &warp.direction[16 * m + lane % 16][8 * (lane / 16)]);
      }
    }
    std::uint32_t first[kTiles][4][4], second[kTiles][4][4];
    dense<Half, kTiles, 2, 4>(features, weights_ + Shape::kPackedLuminance1,
                              [&](int m, int n, const float(&sums)[2][4]) { pack_relu<Half>(sums, first[m][n]); });
    dense<Half, kTiles, 4, 4>(first, weights_ + Shape::kPackedLuminance2,
                              [&](int m, int n, const float(&sums)[2][4]) { pack_relu<Half>(sums, second[m][n]); });
    last_layer(warp, second);
    __syncwarp();
    return warp.luminance[lane];
  }

 private:
  /// The last layer has one output: a dot product in floats.
  __device__ void last_layer(WarpField<KT>& warp, const std::uint32_t (&hidden)[kTiles][4][4]) const {
    const unsigned lane = threadIdx.x % 32, g = lane / 4, t = lane % 4;
    float sum[kTiles][2] = {};
#pragma unroll
    for (int k = 0; k < 4; ++k) {
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const float2 w = *reinterpret_cast<const float2*>(&last_[16 * k + 8 * half + 2 * t]);
#pragma unroll
        for (int m = 0; m < kTiles; ++m) {
#pragma unroll
          for (int row = 0; row < 2; ++row) {
            const float2 a = floats_of_halves(hidden[m][k][2 * half + row]);
            sum[m][row] += w.x * a.x + w.y * a.y;
          }
        }
      }
    }
#pragma unroll
    for (int m = 0; m < kTiles; ++m) {
#pragma unroll
      for (int row = 0; row < 2; ++row) {
        sum[m][row] += __shfl_xor_sync(~0u, sum[m][row], 1);
        sum[m][row] += __shfl_xor_sync(~0u, sum[m][row], 2);
        if (t == 0) warp.luminance[16 * m + g + 8 * row] = sum[m][row];
      }
    }
  }

  const uint2* weights_;
  const float* last_;
};

/// A block's shared memory: the weights once, then each warp's own.
template <int KT, int kWarps>
struct BlockField {
  uint2 weights[FieldShape<KT>::kPacked];
  float last_layer[kHiddenWidth];
  WarpField<KT> warp[kWarps];

  /// By all threads of the block.
  __device__ void load(const PackedField& field) {
    const auto* from = reinterpret_cast<const uint4*>(field.weights.forward);
    auto* to = reinterpret_cast<uint4*>(weights);
    for (unsigned i = threadIdx.x; i < FieldShape<KT>::kPacked / 2; i += blockDim.x) to[i] = from[i];
    for (unsigned i = threadIdx.x; i < kHiddenWidth; i += blockDim.x) last_layer[i] = field.last_layer[i];
    warp[threadIdx.x / 32].clear(threadIdx.x % 32);
    __syncthreads();
  }
};

}  // namespace cnerf
