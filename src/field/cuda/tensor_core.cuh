#pragma once
/// The tensor cores' instructions, and what a lane of a warp holds of their operands.
///
/// One instruction multiplies 16 samples x 16 inputs by 16 inputs x 8 outputs. With g = lane / 4 and t = lane % 4 a
/// lane holds, two 16-bit numbers per register,
///   of the left operand   rows g, g + 8, g, g + 8 at columns 2t, 2t + 1 (registers 0, 1) and 2t + 8, 2t + 9 (2, 3);
///   of the right operand  column g at rows 2t, 2t + 1 (register 0) and 2t + 8, 2t + 9 (1);
///   of the result         row g at columns 2t, 2t + 1 (floats 0, 1) and row g + 8 (2, 3).
/// Two results side by side, rounded to 16 bits, are the left operand of the next layer: activations never leave
/// registers on their way through a net.

#include <cuda_bf16.h>
#include <cuda_fp16.h>

#include <cstdint>

namespace cnerf {

/// Number formats of 16 bits: halves are precise enough for activations, bfloat16 has the range that gradients need.
struct Half {
  __device__ static std::uint32_t pack(float low, float high) {
    const __half2 v = __floats2half2_rn(low, high);
    return *reinterpret_cast<const std::uint32_t*>(&v);
  }
  __device__ static void multiply_add(float (&sum)[4], const std::uint32_t (&a)[4], uint2 b) {
    asm volatile(
        "mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, {%0,%1,%2,%3};"
        : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
        : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b.x), "r"(b.y));
  }
};
struct Bfloat {
  __device__ static std::uint32_t pack(float low, float high) {
    const __nv_bfloat162 v = __floats2bfloat162_rn(low, high);
    return *reinterpret_cast<const std::uint32_t*>(&v);
  }
  __device__ static void multiply_add(float (&sum)[4], const std::uint32_t (&a)[4], uint2 b) {
    asm volatile(
        "mma.sync.aligned.m16n8k16.row.col.f32.bf16.bf16.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, {%0,%1,%2,%3};"
        : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
        : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b.x), "r"(b.y));
  }
};

__device__ inline float2 floats_of_halves(std::uint32_t halves) {
  return __half22float2(*reinterpret_cast<const __half2*>(&halves));
}
__device__ inline std::uint32_t bfloats_of_halves(std::uint32_t halves) {
  const float2 v = floats_of_halves(halves);
  return Bfloat::pack(v.x, v.y);
}

/// Loads a left operand [16, 16] from shared memory.  @param row_of_lane  the row `lane % 16`, at column 8 (lane / 16)
__device__ inline void load_operand(std::uint32_t (&a)[4], const void* row_of_lane) {
  const auto address = std::uint32_t(__cvta_generic_to_shared(row_of_lane));
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 {%0,%1,%2,%3}, [%4];"
               : "=r"(a[0]), "=r"(a[1]), "=r"(a[2]), "=r"(a[3])
               : "r"(address)
               : "memory");
}
/// Four 8 x 8 matrices, each transposed.
__device__ inline void load_transposed(std::uint32_t (&a)[4], const void* row_of_lane) {
  const auto address = std::uint32_t(__cvta_generic_to_shared(row_of_lane));
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0,%1,%2,%3}, [%4];"
               : "=r"(a[0]), "=r"(a[1]), "=r"(a[2]), "=r"(a[3])
               : "r"(address)
               : "memory");
}
__device__ inline uint2 load_transposed_pair(const void* row_of_lane) {
  const auto address = std::uint32_t(__cvta_generic_to_shared(row_of_lane));
  uint2 b;
  asm volatile("ldmatrix.sync.aligned.m8n8.x2.trans.shared.b16 {%0,%1}, [%2];"
               : "=r"(b.x), "=r"(b.y)
               : "r"(address)
               : "memory");
  return b;
}

/// One layer: out = in W, for M tiles of 16 samples.
/// @param weights  fragments [K][2 N][lane], as `packed_place` orders them
/// @param finish   (m, n, sums of output tiles 2n and 2n + 1) -> void
/// @param tiles    output tiles of 8 that the weights have, where this is a part of a wider layer
template <typename Format, int M, int K, int N, typename Finish>
__device__ inline void dense(const std::uint32_t (&in)[M][K][4], const uint2* weights, Finish&& finish,
                             int tiles = 2 * N) {
  const unsigned lane = threadIdx.x % 32;
#pragma unroll
  for (int n = 0; n < N; ++n) {
    float sums[M][2][4] = {};
#pragma unroll
    for (int k = 0; k < K; ++k) {
      const uint2 left = weights[(k * tiles + 2 * n) * 32 + lane], right = weights[(k * tiles + 2 * n + 1) * 32 + lane];
#pragma unroll
      for (int m = 0; m < M; ++m) {
        Format::multiply_add(sums[m][0], in[m][k], left);
        Format::multiply_add(sums[m][1], in[m][k], right);
      }
    }
#pragma unroll
    for (int m = 0; m < M; ++m) finish(m, n, sums[m]);
  }
}

/// The result of two output tiles as a left operand.
template <typename Format>
__device__ inline void pack_operand(const float (&sums)[2][4], std::uint32_t (&operand)[4]) {
  operand[0] = Format::pack(sums[0][0], sums[0][1]);
  operand[1] = Format::pack(sums[0][2], sums[0][3]);
  operand[2] = Format::pack(sums[1][0], sums[1][1]);
  operand[3] = Format::pack(sums[1][2], sums[1][3]);
}
template <typename Format>
__device__ inline void pack_relu(const float (&sums)[2][4], std::uint32_t (&operand)[4]) {
  float positive[2][4];
#pragma unroll
  for (int i = 0; i < 8; ++i) positive[i / 4][i % 4] = fmaxf(sums[i / 4][i % 4], 0.0f);
  pack_operand<Format>(positive, operand);
}

}  // namespace cnerf
