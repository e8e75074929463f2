#pragma once
/// Points of a trained scene in world units, as its pictures show them.

#include <span>

#include "src/field/color_field.h"

namespace cnerf::python {

/// @param sigma  1/world unit; 0 outside the field's box and where the occupancy grid says that nothing is
void query_density(const ColorField& field, std::span<const Vec3d> positions, std::span<float> sigma);
/// @param directions  of unit length, away from the camera: one per position, or one for all
/// @param rgb         linear Rec.709, linear in light, so that a composite of them is exact; it may leave the gamut a
///                    little. 0 outside the field's box
void query_color(const ColorField& field, std::span<const Vec3d> positions, std::span<const Vec3d> directions,
                 std::span<Vec3f> rgb);

}  // namespace cnerf::python
