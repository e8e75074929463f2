#pragma once
/// CPU kernels of the hash grid, one table of functions per instruction set. Raw pointers and no checks: their one
/// caller has checked.
///
/// Samples come in groups of 16 (grouped.h). Groups are padded with valid positions.

#include <cstddef>

#include "encoding/cpu/grouped.h"
#include "encoding/hash_grid_levels.h"
#include "src/base/cpu_features.h"

namespace cnerf {

struct HashGridKernels {
  /// Trilinear interpolation of the table at every level.
  /// @param table      [rows, 4], 16-byte aligned
  /// @param positions  [G, 3, 16], in [0, 1]
  /// @param encoded    [G, channels, 16]; channels 0 .. 4 L - 1 are written
  void (*encode)(const GridLevel* levels, std::size_t n_levels, const float* table, const float* positions,
                 std::size_t groups, float* encoded, int channels);
  /// Adds one level's gradient. Successive samples in one cell are merged before they are written.
  /// @param d_encoded  [G, channels, 16]; channels first_channel .. + 3 are this level's
  /// @param d_rows     [level.rows, 4], added to, in the order of the samples: deterministic
  void (*scatter_level)(const GridLevel& level, const float* positions, const float* d_encoded, std::size_t groups,
                        int channels, int first_channel, float* d_rows);
  /// The gradient by the samples' positions, as far as these levels pass it on.
  /// @param d_encoded    [G, channels, 16]; channels 0 .. 4 L - 1 are read
  /// @param d_positions  [G, 3, 16], written
  void (*position_gradient)(const GridLevel* levels, std::size_t n_levels, const float* table, const float* positions,
                            const float* d_encoded, std::size_t groups, int channels, float* d_positions);
};

namespace generic {
extern const HashGridKernels kHashGridKernels;
}
namespace neon {
extern const HashGridKernels kHashGridKernels;
}
namespace avx2 {
extern const HashGridKernels kHashGridKernels;
}
namespace avx512 {
extern const HashGridKernels kHashGridKernels;
}

/// The kernels of `active_isa()`.
[[nodiscard]] inline const HashGridKernels& hash_grid_kernels() {
  if constexpr (kHasNeon) {
    return kernels_of_isa(generic::kHashGridKernels, neon::kHashGridKernels);
  } else {
    return kernels_of_isa(generic::kHashGridKernels, avx2::kHashGridKernels, avx512::kHashGridKernels);
  }
}

}  // namespace cnerf
