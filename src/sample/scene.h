#pragma once
/// The sample scene itself and its renderer.

#include <cstdint>
#include <optional>
#include <vector>

#include "src/base/aabb.h"
#include "src/capture/camera.h"
#include "src/sample/shapes.h"
#include "src/sample/textures.h"

namespace cnerf::sample {

struct Object {
  Shape shape;
  Texture texture = nullptr;
  double gloss = 0;  ///< strength of the highlight; 0 is matte
};

/// Objects on a round wooden plate of radius 0.93 whose top is z = 0; +Z is up. The plate is the first.
[[nodiscard]] const std::vector<Object>& objects();
/// A box that holds them all.
[[nodiscard]] Aabbd bounds();

struct ScenePoint {
  const Object* object = nullptr;
  double t = 0;
  Vec3d position, normal;
};
/// The first surface along a ray, or nothing.
[[nodiscard]] std::optional<ScenePoint> trace(const Ray& ray);

/// Light leaving a surface point towards the origin of `ray`, linear Rec.709, by `light_samples` squared rays to the
/// sun and as many to the sky.  @param random  a number that all draws derive from.
[[nodiscard]] Vec3d shade(const ScenePoint& point, const Ray& ray, int light_samples, std::uint64_t random);

/// The colour of a pixel.
struct PixelColor {
  Vec3d rgb;         ///< linear Rec.709, premultiplied
  double alpha = 0;  ///< share of the pixel that objects cover
};
/// @param side  samples per pixel along each axis.
[[nodiscard]] PixelColor render_pixel(const Intrinsics& intrinsics, const Affined& world_from_camera, int x, int y,
                                      int side, std::uint64_t random);
/// Distance along the optical axis at the pixel's centre; 0 where there is nothing.
[[nodiscard]] float depth_of_pixel(const Intrinsics& intrinsics, const Affined& world_from_camera, int x, int y);

}  // namespace cnerf::sample
