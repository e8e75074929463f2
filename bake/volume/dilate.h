#pragma once
/// Colour beyond the support of density: renderers interpolate colour and density apart, so at the rim of an object
/// they would mix its colour with black if colour ended where density does.

#include "bake/out_of_core/planes.h"

namespace cnerf::bake {

/// The volume with every missing voxel within `radius` (in each axis) of a voxel with sigma > 0. The new ones have
/// sigma 0 and the colour of the nearest voxel with density; those that interpolation does not reach (two voxels away
/// and more) share one such colour a brick of 8^3, which costs a file nothing. Voxels that exist stay as they are. May
/// make voxels outside [0, resolution). Running it again adds nothing. Each copy holds three planes of bricks.
/// @param radius  [0, 8] voxels.
/// Reading throws ContractError when two voxels share a place.
[[nodiscard]] VolumePlanes dilated(const VolumePlanes& volume, int radius);

/// The same in memory; `volume` need not be sorted, the result is.
void dilate_colors(Volume& volume, int radius);

/// Sorts voxels by (i, j, k).
void sort_voxels(std::vector<Voxel>& voxels);

}  // namespace cnerf::bake
