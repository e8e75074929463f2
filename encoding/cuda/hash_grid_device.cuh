#pragma once
/// The hash grid inside kernels: the loops around hash_grid_math.h's corners.
///
/// Rows are gathered as four halves (8 bytes): a gather costs the same whatever its size up to 16 bytes, and the small
/// table stays in L2. Gradients are summed in float, 16 bytes at a time.

#include <cuda_fp16.h>

#include <cstdint>

#include "encoding/hash_grid_math.h"

namespace cnerf {

/// The levels by value, so that they lie in constant memory as a kernel's parameter.
struct GridLevels {
  GridLevel level[kMaxGridLevels];
  int count = 0;

  GridLevels() = default;
  GridLevels(const GridLevel* levels, std::size_t n) : count(int(n)) {
    for (std::size_t l = 0; l < n; ++l) level[l] = levels[l];
  }
};

__device__ inline float4 operator*(float s, float4 v) {
  return make_float4(s * v.x, s * v.y, s * v.z, s * v.w);
}
__device__ inline void operator+=(float4& a, float4 b) {
  a.x += b.x, a.y += b.y, a.z += b.z, a.w += b.w;
}

__device__ inline uint2 halves_of(float4 v) {
  const __half2 low = __floats2half2_rn(v.x, v.y), high = __floats2half2_rn(v.z, v.w);
  return make_uint2(*reinterpret_cast<const unsigned*>(&low), *reinterpret_cast<const unsigned*>(&high));
}

/// Features of one position at one level, as four halves. The sum is made in halves as well: the kernels that gather
/// are short of instructions, and weights of at most 1 keep the error at that of the table's own rounding. (Loading
/// neighbours along x together where they share 16 bytes saves a quarter of the loads, but was a fifth slower.)
/// @param table  [rows, 4] halves, of all levels
__device__ inline uint2 gather(const GridLevel& level, const uint2* __restrict__ table, const float position[3]) {
  const uint2* rows = table + level.first_row;
  uint2 row[8];
  float weight[8];
  for_each_corner<std::uint32_t>(level, position, [&](std::uint32_t corner, std::uint32_t at, float w) {
    row[corner] = __ldg(rows + at);
    weight[corner] = w;
  });
  __half2 low = __float2half2_rn(0.0f), high = low;
#pragma unroll
  for (int corner = 0; corner < 8; ++corner) {
    const __half2 w = __float2half2_rn(weight[corner]);
    low = __hfma2(w, *reinterpret_cast<const __half2*>(&row[corner].x), low);
    high = __hfma2(w, *reinterpret_cast<const __half2*>(&row[corner].y), high);
  }
  return make_uint2(*reinterpret_cast<const unsigned*>(&low), *reinterpret_cast<const unsigned*>(&high));
}

/// The gradient by a position, as one level passes it on.
__device__ inline void add_position_gradient(const GridLevel& level, const uint2* __restrict__ table,
                                             const float position[3], float4 d_features, float gradient[3]) {
  const uint2* rows = table + level.first_row;
  float projected[8];
  for_each_corner<std::uint32_t>(level, position, [&](std::uint32_t corner, std::uint32_t at, float) {
    const uint2 row = __ldg(rows + at);
    const float2 low = __half22float2(*reinterpret_cast<const __half2*>(&row.x));
    const float2 high = __half22float2(*reinterpret_cast<const __half2*>(&row.y));
    projected[corner] = low.x * d_features.x + low.y * d_features.y + high.x * d_features.z + high.y * d_features.w;
  });
  float slope[3];
  trilinear_slope(locate<std::uint32_t>(level, position).fraction, projected, slope);
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) gradient[axis] += float(level.cells) * slope[axis];
}

/// Adds four floats to a row of a gradient; nothing waits for it.
__device__ inline void add_to_row(float* row, float4 value) {
#if __CUDA_ARCH__ >= 900
  asm volatile("red.global.add.v4.f32 [%0], {%1, %2, %3, %4};" ::"l"(row), "f"(value.x), "f"(value.y), "f"(value.z),
               "f"(value.w));  // no memory clobber: kernels that add do not read
#else
  atomicAdd(row, value.x), atomicAdd(row + 1, value.y), atomicAdd(row + 2, value.z), atomicAdd(row + 3, value.w);
#endif
}

/// The gradient of one corner of a cell, gathered over successive samples in the cell: a ray visits the same one
/// several times in a row. Eight lanes share a run of samples, a corner each, so that neighbouring rows are written
/// together.
class CornerRun {
 public:
  /// @param corner  0..7, bit 0 = upper in x
  __device__ CornerRun(const GridLevel& level, std::uint32_t corner, float* d_rows)
      : level_(level), corner_(corner), d_rows_(d_rows) {}

  __device__ void add(const float position[3], float4 d_features) {
    const GridCell<float, std::uint32_t> cell = locate<std::uint32_t>(level_, position);
    if (cell.corner[0] != cell_[0] || cell.corner[1] != cell_[1] || cell.corner[2] != cell_[2]) {
      write();
      for (int axis = 0; axis < 3; ++axis) cell_[axis] = cell.corner[axis];
      sum_ = make_float4(0, 0, 0, 0);
    }
    float weight = 1;
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      weight *= ((corner_ >> axis) & 1u) != 0 ? cell.fraction[axis] : 1.0f - cell.fraction[axis];
    }
    sum_ += weight * d_features;
  }
  __device__ void write() const {
    if (cell_[0] == kNone) return;
    const std::uint32_t row = row_of_point<std::uint32_t>(level_, cell_[0] + (corner_ & 1u),
                                                          cell_[1] + (corner_ >> 1 & 1u), cell_[2] + (corner_ >> 2));
    add_to_row(d_rows_ + 4 * std::size_t(row), sum_);
  }

 private:
  static constexpr std::uint32_t kNone = ~0u;
  const GridLevel& level_;
  std::uint32_t corner_;
  float* d_rows_;
  float4 sum_ = {};
  std::uint32_t cell_[3] = {kNone, kNone, kNone};
};

}  // namespace cnerf
