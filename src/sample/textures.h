#pragma once
/// Procedural colours of the sample scene: linear Rec.709 reflectance as a function of a position in a shape's frame.
/// All vary in luminance at the scale of a few centimetres of the scene, so that views can be matched without colour.

#include "src/base/vec3.h"

namespace cnerf::sample {

using Texture = Vec3d (*)(Vec3d position);

[[nodiscard]] Vec3d planks(Vec3d position);         ///< brown boards with grain
[[nodiscard]] Vec3d striped_ball(Vec3d position);   ///< red with cream bands
[[nodiscard]] Vec3d blue_checker(Vec3d position);   ///< two blues
[[nodiscard]] Vec3d foliage(Vec3d position);        ///< greens, mottled
[[nodiscard]] Vec3d terracotta(Vec3d position);     ///< banded pot
[[nodiscard]] Vec3d yellow_spots(Vec3d position);   ///< yellow with brown spots
[[nodiscard]] Vec3d purple_wedges(Vec3d position);  ///< around the axis
[[nodiscard]] Vec3d orange_peel(Vec3d position);    ///< orange, dimpled
[[nodiscard]] Vec3d teal_bricks(Vec3d position);    ///< bricks with pale joints
[[nodiscard]] Vec3d pebble(Vec3d position);         ///< neutral greys
[[nodiscard]] Vec3d pink_swirl(Vec3d position);     ///< rose and pale pink

/// Smooth noise in [0, 1] with features of size 1; `octaves` add finer ones at half the strength each.
[[nodiscard]] double noise(Vec3d position, int octaves);

}  // namespace cnerf::sample
