#pragma once
/// The hash grid's algorithm, once: Mueller et al. 2022, Sec. 3. Templated on the number type, so that the double
/// reference, the SIMD lanes and CUDA kernels use this very text and differ only in who loops.
///
/// `Real` is float, double or a lane class of floats; `Index` the matching unsigned 32-bit type. For lane classes,
/// `to_index`, `smaller` and `to_real` are found by argument-dependent lookup.

#include <cstdint>

#include "encoding/hash_grid_levels.h"
#include "src/base/host_device.h"

namespace cnerf {

CNERF_HD inline std::uint32_t to_index(float x) {
  return std::uint32_t(std::int32_t(x));
}
CNERF_HD inline std::uint32_t to_index(double x) {
  return std::uint32_t(std::int32_t(x));
}
CNERF_HD inline std::uint32_t smaller(std::uint32_t a, std::uint32_t b) {
  return a < b ? a : b;
}
CNERF_HD inline void to_real(std::uint32_t i, float& x) {
  x = float(i);
}
CNERF_HD inline void to_real(std::uint32_t i, double& x) {
  x = double(i);
}

/// The cell that holds a position, and where in the cell it is.
template <typename Real, typename Index>
struct GridCell {
  Index corner[3];   ///< integer coordinates of the cell's lowest corner
  Real fraction[3];  ///< in [0, 1]
};

/// @param position  in [0, 1] on each axis; 1 is the upper face of the last cell, at fraction 1: a cell beyond it would
///                  have grid points outside the level, whose rows may belong to another level.
template <typename Index, typename Real>
CNERF_HD GridCell<Real, Index> locate(const GridLevel& level, const Real position[3]) {
  GridCell<Real, Index> cell;
  for (int axis = 0; axis < 3; ++axis) {
    const Real scaled = position[axis] * Real(float(level.cells));
    cell.corner[axis] = smaller(to_index(scaled), Index(level.cells - 1u));
    Real floor;
    to_real(cell.corner[axis], floor);
    cell.fraction[axis] = scaled - floor;
  }
  return cell;
}

/// Row, within the level, of the grid point (x, y, z): Eq. 4's hash, or the dense index where the level is small.
template <typename Index>
CNERF_HD Index row_of_point(const GridLevel& level, Index x, Index y, Index z) {
  if (level.hashed) {
    const Index hash = x ^ (y * Index(2654435761u)) ^ (z * Index(805459861u));
    return hash & Index(level.rows - 1u);
  }
  const Index stride = Index(level.cells + 1u);
  return x + stride * (y + stride * z);
}

/// Calls `visit(corner, row, weight)` for the 8 corners of the position's cell; weights are trilinear and sum to 1.
template <typename Index, typename Real, typename Visit>
CNERF_HD void for_each_corner(const GridLevel& level, const Real position[3], Visit&& visit) {
  const GridCell<Real, Index> cell = locate<Index>(level, position);
  const Real one = Real(1.0f);
  for (std::uint32_t corner = 0; corner < 8; ++corner) {
    Index point[3];
    Real weight[3];
    for (int axis = 0; axis < 3; ++axis) {
      const bool upper = ((corner >> axis) & 1u) != 0;
      point[axis] = upper ? cell.corner[axis] + Index(1u) : cell.corner[axis];
      weight[axis] = upper ? cell.fraction[axis] : one - cell.fraction[axis];
    }
    visit(corner, row_of_point(level, point[0], point[1], point[2]), weight[0] * weight[1] * weight[2]);
  }
}

/// Derivative of what trilinear interpolation makes of values at a cell's corners, by the place in the cell. Inside a
/// cell it is exact; where cells meet it jumps.
/// @param fraction   in [0, 1], see GridCell
/// @param at_corner  bit 0 of the index = upper in x
/// @param slope      written
template <typename Real>
CNERF_HD void trilinear_slope(const Real fraction[3], const Real at_corner[8], Real slope[3]) {
  const Real one = Real(1.0f);
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto across = [&](int corner) { return at_corner[corner | (1 << axis)] - at_corner[corner]; };
    slope[axis] = (one - fraction[v]) * ((one - fraction[u]) * across(0) + fraction[u] * across(1 << u)) +
                  fraction[v] * ((one - fraction[u]) * across(1 << v) + fraction[u] * across((1 << u) | (1 << v)));
  }
}

}  // namespace cnerf
