#pragma once
/// The layout of a multiresolution hash grid (Mueller et al. 2022, Sec. 3): L levels of resolutions between N_min and
/// N_max, each with at most T rows of F features. No Torch, no device: what the back ends share.

#include <cstdint>
#include <vector>

#include "src/base/options.h"

namespace cnerf {

inline constexpr int kMaxGridLevels = 16;

struct HashGridOptions {
  int levels = 8;
  int log2_rows = 15;
  int coarsest_resolution = 16;
  int finest_resolution = 1024;
  double decay = 0;

  template <typename Visitor>
  void visit(Visitor&& v) {
    v("levels", levels, Range{1, kMaxGridLevels}, "levels of the hash grid (L)");
    v("log2_rows", log2_rows, Range{8, 24}, "log2 of the rows a level has at most (T)");
    v("coarsest_resolution", coarsest_resolution, Range{2, 1024}, "cells along an axis of the coarsest level (N_min)");
    v("finest_resolution", finest_resolution, Range{2, 65536}, "cells along an axis of the finest level (N_max)");
    v("decay", decay, Range{0, 10}, "weight decay of the rows that a step moves, in units of the learning rate");
  }
};

struct GridLevel {
  std::uint32_t first_row = 0;  ///< of this level in the table
  std::uint32_t rows = 0;       ///< a power of two when hashed, else (cells + 1)^3 rounded up to 8
  std::uint32_t cells = 0;      ///< N_l, along an axis; positions in [0, 1] scale to [0, cells]
  bool hashed = false;          ///< rows are found by the hash of Eq. 4, else by x + y (N + 1) + z (N + 1)^2
};

/// Levels with resolutions N_l = floor(N_min * b^l), b = exp((ln N_max - ln N_min) / (L - 1))  (Eq. 2 and 3).
[[nodiscard]] std::vector<GridLevel> hash_grid_levels(const HashGridOptions& options);
/// Rows of all levels together.
[[nodiscard]] std::uint32_t total_rows(const std::vector<GridLevel>& levels);

}  // namespace cnerf
