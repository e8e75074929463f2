#pragma once
/// Which voxels a bake works on, decided before any of them is computed.

#include <cstddef>

#include "bake/options.h"
#include "src/base/aabb.h"
#include "src/field/color_field.h"

namespace cnerf::bake {

/// The lattice of a bake. Voxel ijk covers [ijk, ijk + 1) * voxel_size + origin, world units.
struct Plan {
  Aabbd box;                     ///< world; what is baked. The lattice reaches `dilation` voxels beyond it
  Vec3d origin{};                ///< world; corner of voxel (0, 0, 0)
  double voxel_size = 0;         ///< world units
  Vec3i resolution{};            ///< voxels along each axis, margin included
  Vec3i hole_min{}, hole_max{};  ///< voxels [hole_min, hole_max) are those of a finer grid; none when equal

  [[nodiscard]] Vec3d world_from_voxel(Vec3d p) const { return p * voxel_size + origin; }
  [[nodiscard]] Vec3d voxel_from_world(Vec3d p) const { return (p - origin) / voxel_size; }
  [[nodiscard]] bool in_hole(Vec3i v) const {
    return v.x >= hole_min.x && v.y >= hole_min.y && v.z >= hole_min.z && v.x < hole_max.x && v.y < hole_max.y &&
           v.z < hole_max.z;
  }
  [[nodiscard]] std::size_t lattice_voxels() const { return std::size_t(resolution.x) * resolution.y * resolution.z; }
};

/// @throws UsageError  when `aabb` is not six ordered numbers, lies outside the field's box or the lattice would have
///                     more than 2^15 voxels along an axis.
/// @throws InputError  when the field is empty everywhere.
[[nodiscard]] Plan plan_bake(const ColorField& field, const Options& options);

}  // namespace cnerf::bake
