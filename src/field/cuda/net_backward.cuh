#pragma once
/// Building blocks of the nets' backward passes. Inputs and gradients of layers lie in shared memory as rows of
/// bfloat16, one row per sample; a warp keeps its part of a weight gradient in registers.

#include "src/field/cuda/tensor_core.cuh"

namespace cnerf {

/// Row `g` (half 0) or `g + 8` (half 1) of a left operand from a sample's stored features, [.., 16 KT] halves.
template <int KT>
__device__ void load_encoded(std::uint32_t (&operand)[KT][4], int half, const uint4* encoded, std::uint32_t sample) {
  const auto* row = reinterpret_cast<const std::uint32_t*>(encoded + std::size_t(sample) * (2 * KT));
#pragma unroll
  for (int k = 0; k < KT; ++k) {
    operand[k][half] = row[8 * k + threadIdx.x % 4];
    operand[k][half + 2] = row[8 * k + threadIdx.x % 4 + 4];
  }
}

/// Where the hash grid's levels receive their gradients: four channels per level.
struct LevelGradients {
  int levels;
  std::uint32_t count, most;  ///< samples there are, and the array's capacity
  void* d_encoded;            ///< [levels, most, 4] of bfloat16

  /// A result's 16 columns from `16 tile` on.  @param sample  of rows g and g + 8; those from `count` on do not exist
  __device__ void write(const float (&sums)[2][4], int tile, const std::uint32_t (&sample)[2]) const {
    const int t = int(threadIdx.x) % 4;
#pragma unroll
    for (int block = 0; block < 2; ++block) {
      const int level = 4 * tile + 2 * block + t / 2;  // of two lanes
      if (level >= levels) continue;
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        if (sample[half] >= count) continue;
        static_cast<std::uint32_t*>(d_encoded)[(std::size_t(level) * most + sample[half]) * 2 + t % 2] =
            Bfloat::pack(sums[block][2 * half], sums[block][2 * half + 1]);
      }
    }
  }
};

/// Which numbers of a left operand of 64 columns are positive: bit 4 k + register of either half word.
__device__ inline std::uint32_t positive_bits(const std::uint32_t (&halves)[4][4]) {
  std::uint32_t bits = 0;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      const std::uint32_t mask =
          __hgt2_mask(*reinterpret_cast<const __half2*>(&halves[k][r]), __half2half2(__half(0.0f)));
      bits |= mask & (0x00010001u << (4 * k + r));
    }
  }
  return bits;
}
__device__ inline std::uint32_t gate(std::uint32_t pair, std::uint32_t bits, int k, int r) {
  return pair & (((bits >> (4 * k + r)) & 0x00010001u) * 0xffffu);
}

/// Stores a left operand's part of 16 columns as rows, from `row` = the warp's first one.
template <int stride>
__device__ void store_rows(__nv_bfloat16 (*rows)[stride], int row, int column, const std::uint32_t (&bfloats)[4]) {
  const int g = int(threadIdx.x) % 32 / 4, t = int(threadIdx.x) % 4;
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    *reinterpret_cast<std::uint32_t*>(&rows[row + g + 8 * (r % 2)][column + 2 * t + 8 * (r / 2)]) = bfloats[r];
  }
}
/// From a gradient by 16 outputs of a hidden layer, from `16 tile` on, to that in front of its ReLU: as a left operand,
/// and as rows.
/// @param bits  `positive_bits` of the layer
template <int stride>
__device__ void through_relu(const float (&sums)[2][4], std::uint32_t bits, int tile, std::uint32_t (&operand)[4],
                             __nv_bfloat16 (*rows)[stride], int row) {
  pack_operand<Bfloat>(sums, operand);
#pragma unroll
  for (int r = 0; r < 4; ++r) operand[r] = gate(operand[r], bits, tile, r);
  store_rows(rows, row, 16 * tile, operand);
}
template <int stride, int K>
__device__ void store_halves(__nv_bfloat16 (*rows)[stride], int row, const std::uint32_t (&halves)[K][4]) {
#pragma unroll
  for (int k = 0; k < K; ++k) {
    std::uint32_t bfloats[4];
#pragma unroll
    for (int r = 0; r < 4; ++r) bfloats[r] = bfloats_of_halves(halves[k][r]);
    store_rows(rows, row, 16 * k, bfloats);
  }
}

/// sums[i] += rows of d_out (16 outputs from `out`) transposed times rows of in (8 inputs from `in + 8 i`).
template <int rows, int N, int out_stride, int in_stride>
__device__ void add_weight_gradient(float (&sums)[N][4], const __nv_bfloat16 (*d_out)[out_stride], int out,
                                    const __nv_bfloat16 (*inputs)[in_stride], int in) {
  const int lane = int(threadIdx.x) % 32;
#pragma unroll 2
  for (int k = 0; k < rows; k += 16) {
    std::uint32_t a[4];
    load_transposed(a, &d_out[k + lane % 8 + lane / 16 * 8][out + lane / 8 % 2 * 8]);
    if constexpr (N % 2 == 0) {
#pragma unroll
      for (int i = 0; i < N; i += 2) {
        std::uint32_t b[4];
        load_transposed(b, &inputs[k + lane % 16][in + 8 * i + lane / 16 * 8]);
        Bfloat::multiply_add(sums[i], a, make_uint2(b[0], b[1]));
        Bfloat::multiply_add(sums[i + 1], a, make_uint2(b[2], b[3]));
      }
    } else {
#pragma unroll
      for (int i = 0; i < N; ++i) {
        Bfloat::multiply_add(sums[i], a, load_transposed_pair(&inputs[k + lane % 16][in + 8 * i]));
      }
    }
  }
}
template <int N>
__device__ void write_weight_gradient(const float (&sums)[N][4], float* d_weights, int inputs, int out, int in) {
  const int g = int(threadIdx.x) % 32 / 4, t = int(threadIdx.x) % 4;
#pragma unroll
  for (int i = 0; i < N; ++i) {
    float* at = d_weights + (out + g) * inputs + in + 8 * i + 2 * t;
    *reinterpret_cast<float2*>(at) = make_float2(sums[i][0], sums[i][1]);
    *reinterpret_cast<float2*>(at + 8 * inputs) = make_float2(sums[i][2], sums[i][3]);
  }
}

}  // namespace cnerf
