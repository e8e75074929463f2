#pragma once
/// CPU kernels of the hash grid, one table of functions per instruction set. Raw pointers and no checks: their one
/// caller has checked.
///
/// Samples come in groups of 16. A "grouped" array [G, C, 16] holds channel c of sample 16 g + i at (g C + c) 16 + i,
/// so that one channel of a group is one AVX-512 register. Groups are padded with valid positions.

#include <cstddef>

#include "encoding/hash_grid_levels.h"
#include "src/base/cpu_features.h"

namespace cnerf {

inline constexpr int kGroup = 16;  ///< samples a group

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
  /// Adam on the rows whose gradient is not zero; those gradients are set to zero. Rows without gradient keep their
  /// moments, as in Mueller et al. 2022, Sec. 4.
  /// @param kept     what weight decay leaves of a row's features, 1 without
  /// @param moments  [rows, 8]: first moments of a row's 4 features, then second moments
  void (*adam_rows)(float* table, float* d_rows, float* moments, std::size_t rows, float kept, float step_size,
                    float beta1, float beta2, float epsilon, float second_correction);
};

/// The kernels of `active_isa()`.
[[nodiscard]] const HashGridKernels& hash_grid_kernels();

namespace generic {
extern const HashGridKernels kHashGridKernels;
}
namespace avx2 {
extern const HashGridKernels kHashGridKernels;
}
namespace avx512 {
extern const HashGridKernels kHashGridKernels;
}

}  // namespace cnerf
