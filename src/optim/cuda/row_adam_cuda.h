#pragma once
/// Adam on the rows of a hash grid's table, on the GPU. Kernels gather rows rounded to halves.

#include <cuda_runtime_api.h>

#include <cstdint>

#include "src/optim/adam.h"

namespace cnerf {

/// A table in device memory with its gradient and moments.
struct TableRowsCuda {
  float4* values = nullptr;    ///< [count]
  float4* gradient = nullptr;  ///< [count]
  float4* moments = nullptr;   ///< [count, 2]: first moments, then second ones
  uint2* halves = nullptr;     ///< [count], the values rounded to four halves
  std::uint32_t count = 0;

  [[nodiscard]] TableRowsCuda some(std::uint32_t first, std::uint32_t rows) const {
    return {values + first, gradient + first, moments + 2 * std::size_t(first), halves + first, rows};
  }
};

/// Updates the rows whose gradient is not zero and rounds the values again.
/// @param packed  null: the rows' own gradient, which is cleared; else one that `pack_gradient` made, [rows.count]
/// @param adam    device memory
/// @param decay   weight decay, in units of the learning rate
void update_rows(const TableRowsCuda& rows, const uint2* packed, const AdamStep* adam, float decay,
                 cudaStream_t stream);
/// Rounds the gradient to four bfloat16 per row, written to `packed`, and clears it.
void pack_gradient(const TableRowsCuda& rows, uint2* packed, cudaStream_t stream);
/// Only rounds the values.
void round_rows(const TableRowsCuda& rows, cudaStream_t stream);

}  // namespace cnerf
