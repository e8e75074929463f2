#pragma once
/// Density on the lattices of a bake: what volumes and meshes are both made from.

#include <span>
#include <vector>

#include "bake/lattice/brick_grid.h"
#include "bake/lattice/plan.h"
#include "bake/out_of_core/journal.h"
#include "src/base/progress.h"

namespace cnerf::bake {

/// One grid of a bake. Where grids are nested, a coarser one has a hole where the next finer one lies.
struct Level {
  Plan plan;
  BrickGrid<float> sigma;  ///< 1/world unit; only voxels dense enough to be kept, else 0
};

/// Planes of bricks of all of them.
[[nodiscard]] std::size_t plane_count(std::span<const Level> levels);

/// Planes of bricks that are baked at the same time, so that the GPU and the threads wait less for each other; one
/// where memory is limited. It takes several threads to bake one.
[[nodiscard]] std::size_t planes_at_a_time(const Options& options);

/// First half of a bake: density on each lattice of plan_levels, 1/world unit. What the journal has of it is not made
/// again; what is made goes there.
/// @param journal  of this bake and no other, see journal.h.
/// @throws JournalError   when the journal holds what this bake cannot have made.
/// @throws InputError     when nothing is as opaque as `opacity_threshold`.
/// @throws ContractError  when the field answers NaN, infinity or a negative density.
/// @throws OutputError    when the journal cannot be written.
/// @throws Interrupted    on Ctrl-C, between planes of bricks.
[[nodiscard]] std::vector<Level> bake_levels(const ColorField& field, const std::vector<Plan>& plans,
                                             const Options& options, Journal& journal,
                                             const ProgressSink& progress = {});

/// Density to write for a voxel. Renderers interpolate between voxels, which carries dense matter half a voxel into
/// what is empty beside it: rims grow, and rays that graze a surface are stopped before it. So what a voxel's
/// neighbours would bring into it (the mean over the voxel of what is interpolated, minus the voxel itself) is taken
/// off, `strength` times. Only taken off: where density is even, rises evenly, or peaks, nothing changes, so fog, slabs
/// and thin sheets keep their optical depth. What lies beyond the level's box, or in the hole of a finer one, is taken
/// to be like the voxel itself.
/// @param strength  0 changes nothing; 1 takes all of it off.
/// @return  1/world unit, from 0 to the density baked.
[[nodiscard]] float sharpened_density(const Level& level, Vec3i voxel, double strength);

}  // namespace cnerf::bake
