#pragma once
/// A baked colour volume: plain data, no network, no file format.

#include <cstdint>
#include <vector>

#include "src/base/vec3.h"
#include "src/field/scene_frame.h"

namespace cnerf::bake {

/// One voxel. Cell-centred: voxel ijk covers [ijk, ijk + 1) * voxel_size + origin of the world frame.
struct Voxel {
  std::int32_t i = 0, j = 0, k = 0;
  float sigma = 0;      ///< 1/world unit, >= 0; 0 for voxels that only carry dilated colour
  float luminance = 0;  ///< linear Y
  Vec3f rgb{};          ///< linear Rec.709, in gamut
  float a = 0, b = 0;   ///< CIE Lab a and b of `rgb`
  friend bool operator==(const Voxel&, const Voxel&) = default;
};

/// All of a volume but its voxels.
struct VolumeHeader {
  Vec3d origin{};         ///< world position of the corner of voxel (0, 0, 0)
  double voxel_size = 0;  ///< world units; cubic voxels
  Vec3i resolution{};     ///< voxels along each axis of the baked box
  SceneFrame frame;       ///< of the field it was baked from
};

struct Volume : VolumeHeader {
  std::vector<Voxel> voxels;  ///< sparse; sorted by (i, j, k), no duplicates
};

}  // namespace cnerf::bake
