#pragma once
/// The hash grid as nested loops a reader can check by eye. Every other back end is defined as equal to this one.

#include <cstddef>
#include <vector>

#include "encoding/hash_grid_math.h"

namespace cnerf {

/// @param table      [rows, 4]
/// @param positions  [n, 3], in [0, 1]
/// @return           [n, 4 L]
template <typename Real>
std::vector<Real> encode_reference(const std::vector<GridLevel>& levels, const std::vector<Real>& table,
                                   const std::vector<Real>& positions) {
  const std::size_t n = positions.size() / 3;
  std::vector<Real> encoded(n * levels.size() * 4, Real(0));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
      Real* out = &encoded[(i * levels.size() + l) * 4];
      for_each_corner<std::uint32_t>(levels[l], &positions[3 * i], [&](std::uint32_t, std::uint32_t row, Real weight) {
        const Real* features = &table[4 * (std::size_t(levels[l].first_row) + row)];
        for (int f = 0; f < 4; ++f) out[f] += weight * features[f];
      });
    }
  }
  return encoded;
}

/// Gradient of the loss with respect to the table.
/// @param d_encoded  [n, 4 L]
/// @return           [rows, 4]
template <typename Real>
std::vector<Real> encode_backward_reference(const std::vector<GridLevel>& levels, const std::vector<Real>& positions,
                                            const std::vector<Real>& d_encoded) {
  const std::size_t n = positions.size() / 3;
  std::vector<Real> d_table(std::size_t(total_rows(levels)) * 4, Real(0));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
      const Real* d_out = &d_encoded[(i * levels.size() + l) * 4];
      for_each_corner<std::uint32_t>(levels[l], &positions[3 * i], [&](std::uint32_t, std::uint32_t row, Real weight) {
        Real* d_features = &d_table[4 * (std::size_t(levels[l].first_row) + row)];
        for (int f = 0; f < 4; ++f) d_features[f] += weight * d_out[f];
      });
    }
  }
  return d_table;
}

}  // namespace cnerf
