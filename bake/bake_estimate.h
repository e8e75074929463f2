#pragma once
/// What a bake will need, before it is run.

#include <cstddef>
#include <vector>

#include "bake/bake_plan.h"

namespace cnerf {

/// Extrapolated from some of the bricks: about.
struct BakeEstimate {
  std::size_t voxels = 0;        ///< with density; how many of them a camera sees is not known yet
  std::size_t memory_bytes = 0;  ///< that a bake of volumes takes beside what the process holds already
  std::size_t disk_bytes = 0;    ///< of its journal
  std::size_t file_bytes = 0;    ///< of VDB files in half precision, before compression
};

/// @param plans  all grids of the bake.
/// @throws ContractError  as bake_density_plane.
[[nodiscard]] BakeEstimate estimate_bake(const ColorField& field, const std::vector<BakePlan>& plans,
                                         const BakeOptions& options);

/// @param held_bytes  what the process holds already.
/// @throws UsageError  when `options.max_memory` is no amount of memory, or less than the bake will take.
void check_memory(const BakeEstimate& estimate, std::size_t held_bytes, const BakeOptions& options);

}  // namespace cnerf
