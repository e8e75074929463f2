#pragma once
/// Emission and absorption through a baked volume, straight from its voxels: what any renderer with trilinear
/// interpolation should show. Slow and simple; exports are checked against it.

#include <memory>
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

/// What volumes hold at points, by the same rules. Thread-safe.
class VolumeLookup {
 public:
  /// @throws ContractError  on no volume, or one without voxels
  explicit VolumeLookup(std::span<const Volume> volumes);
  ~VolumeLookup();

  /// @param positions  world units; the others are written and have their size
  /// @param sigma      1/world unit; 0 outside
  /// @param rgb        linear Rec.709 of what is there, by density; 0 where density is
  void query(std::span<const Vec3d> positions, std::span<float> sigma, std::span<Vec3f> rgb) const;

 private:
  struct Media;
  std::unique_ptr<const Media> media_;
};

}  // namespace cnerf::bake
