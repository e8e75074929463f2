#pragma once
/// A baked volume at fewer voxels, for viewers. OpenVDB's resampleToMatch samples; this averages, colours by their
/// light.

#include "bake/volume.h"

namespace cnerf::bake {

/// The volume with at most `resolution` voxels along its longest axis. What is there already is returned as it is:
/// voxels are never made smaller. A new voxel's density is the mean over its cube, so that the optical depth of what is
/// thin is kept; its colour and luminance are the means of what it covers, weighted by the light that each part emits.
/// Voxels without density are left out: call dilate_colors where colour has to reach beyond.
/// @throws ContractError  on an empty volume or a resolution below 1.
[[nodiscard]] Volume resample_volume(const Volume& volume, int resolution);

/// Nested volumes (finest first, faces on faces, as bake_volumes makes them) as one with the voxels of the coarsest, by
/// the same rule. One volume comes back as it is.
[[nodiscard]] Volume merged_volume(std::vector<Volume> volumes);

}  // namespace cnerf::bake
