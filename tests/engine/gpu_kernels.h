#pragma once
/// Single kernels of the GPU on host arrays. Builds without CUDA have functions that throw.

#include <vector>

#include "encoding/hash_grid_levels.h"
#include "src/optim/adam.h"

namespace cnerf::test {

/// @param table      [rows, 4]
/// @param positions  [n, 3]
/// @return           [n, 4 L]
[[nodiscard]] std::vector<float> gpu_encode(const std::vector<GridLevel>& levels, const std::vector<float>& table,
                                            const std::vector<float>& positions);
/// @param d_encoded  [n, 4 L]
/// @return           [rows, 4]
[[nodiscard]] std::vector<float> gpu_encode_backward(const std::vector<GridLevel>& levels,
                                                     const std::vector<float>& positions,
                                                     const std::vector<float>& d_encoded);

struct RowProblem {
  std::vector<float> values, gradient, moments;  ///< [rows, 4], [rows, 4], [rows, 8]
  AdamStep step;
  float decay = 0;
};
void gpu_update_rows(RowProblem& problem);

}  // namespace cnerf::test
