#pragma once
/// Density that renderers' interpolation gives back as it was.

#include "bake/density/levels.h"

namespace cnerf::bake {

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
