#pragma once
/// Adam on the rows of a hash grid's table, on the processor.

#include <cstddef>

#include "src/optim/adam.h"

namespace cnerf {

/// Rows of one level's table with their gradients and moments.
struct TableRows {
  float* values = nullptr;    ///< [count, 4]
  float* gradient = nullptr;  ///< [count, 4]
  float* moments = nullptr;   ///< [count, 8]: first moments of a row's 4 features, then second moments
  std::size_t count = 0;
};

/// Updates the rows whose gradient is not zero, and sets those gradients to zero. Rows without gradient keep their
/// moments, as in Mueller et al. 2022, Sec. 4.
/// @param decay  weight decay, in units of the learning rate
void update_rows(const TableRows& rows, const AdamStep& step, float decay);

}  // namespace cnerf
