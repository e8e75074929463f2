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

/// Gradient of the loss with respect to the positions.
/// @param levels  that count, coarsest first
/// @return        [n, 3]
template <typename Real>
std::vector<Real> position_gradient_reference(const std::vector<GridLevel>& grid, std::size_t levels,
                                              const std::vector<Real>& table, const std::vector<Real>& positions,
                                              const std::vector<Real>& d_encoded) {
  std::vector<Real> gradient(positions.size(), Real(0));
  for (std::size_t i = 0; i < positions.size() / 3; ++i) {
    for (std::size_t l = 0; l < levels; ++l) {
      const Real* d_out = &d_encoded[(i * grid.size() + l) * 4];
      Real at_corner[8] = {}, slope[3];
      for_each_corner<std::uint32_t>(grid[l], &positions[3 * i],
                                     [&](std::uint32_t corner, std::uint32_t row, Real /*weight*/) {
                                       const Real* features = &table[4 * (std::size_t(grid[l].first_row) + row)];
                                       for (int f = 0; f < 4; ++f) at_corner[corner] += features[f] * d_out[f];
                                     });
      trilinear_slope(locate<std::uint32_t>(grid[l], &positions[3 * i]).fraction, at_corner, slope);
      for (int axis = 0; axis < 3; ++axis) gradient[3 * i + std::size_t(axis)] += Real(grid[l].cells) * slope[axis];
    }
  }
  return gradient;
}

}  // namespace cnerf
