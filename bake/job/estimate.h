#pragma once
/// What a bake will need, before it is run.

#include <cstddef>
#include <vector>

#include "bake/lattice/plan.h"
#include "bake/out_of_core/planes.h"

namespace cnerf::bake {

/// Extrapolated from some of the bricks: about.
struct Estimate {
  std::size_t voxels = 0;         ///< with density; how many of them a camera sees is not known yet
  std::size_t memory_bytes = 0;   ///< that finding voxels takes beside what the process holds already
  std::size_t writing_bytes = 0;  ///< that writing their files will take at most: where a camera sees every one
  std::size_t disk_bytes = 0;     ///< of its journal
  std::size_t file_bytes = 0;     ///< of VDB files in half precision, before compression
};

/// @param plans  all grids of the bake.
/// @throws ContractError  as bake_density_plane.
[[nodiscard]] Estimate estimate_bake(const ColorField& field, const std::vector<Plan>& plans, const Options& options);

/// Before voxels are looked for.
/// @param held_bytes  what the process holds already.
/// @throws UsageError  when `options.max_memory` is no amount of memory, or less than finding them will take.
void check_memory(const Estimate& estimate, std::size_t held_bytes, const Options& options);

/// Before voxels are written, of which cameras may see a small part: goes through them once, if there is a limit.
/// @throws UsageError  when `options.max_memory` is less than writing them will take; they are kept in the journal.
void check_writing_memory(const std::vector<VolumePlanes>& volumes, std::size_t held_bytes, const Options& options);

}  // namespace cnerf::bake
