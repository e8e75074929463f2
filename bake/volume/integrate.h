#pragma once
/// Emission and absorption through a baked volume, straight from its voxels: what any renderer with trilinear
/// interpolation should show. Slow and simple; exports are checked against it.

#include <span>
#include <vector>

#include "bake/volume.h"
#include "src/capture/camera.h"

namespace cnerf::bake {

struct IntegratorOptions {
  double step = 0.25;        ///< voxels, the finest that are near
  int samples_per_axis = 4;  ///< rays a pixel = its square, at the centres of equal sub-pixels (box filter)
};

struct VolumeImage {
  int width = 0, height = 0;
  std::vector<float> rgb;      ///< [H, W, 3] linear Rec.709, premultiplied by opacity
  std::vector<float> opacity;  ///< [H, W] 0..1
};

/// Several volumes emit and absorb side by side, as nested grids do: densities add, light adds by density.
/// Density and colour are cell-centred and interpolated trilinearly, each by itself; both are 0 where no voxel is.
/// Every step absorbs 1 - exp(-sigma dt) with the values at its middle.
[[nodiscard]] VolumeImage integrate_volumes(std::span<const Volume> volumes, const Intrinsics& intrinsics,
                                            const Affined& world_from_camera, const IntegratorOptions& options = {});
[[nodiscard]] VolumeImage integrate_volume(const Volume& volume, const Intrinsics& intrinsics,
                                           const Affined& world_from_camera, const IntegratorOptions& options = {});

}  // namespace cnerf::bake
