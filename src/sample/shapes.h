#pragma once
/// Solid shapes of the sample scene and their intersection with rays.

#include <optional>

#include "src/base/vec3.h"

namespace cnerf::sample {

struct Ray {
  Vec3d origin, direction;  ///< direction of unit length
};

/// Where a ray enters a shape; `normal` is of unit length and points outwards.
struct SurfaceHit {
  double t = 0;
  Vec3d normal;
};

enum class ShapeKind {
  kSphere,    ///< radius a
  kBox,       ///< half sides a, b, c
  kCylinder,  ///< radius a, half height b, axis z
  kCone,      ///< radius a at z = 0, tip at z = b
  kCapsule,   ///< radius a, half length of its axis b, axis z
  kTorus,     ///< radius a of the ring, radius b of the tube, axis z
};

/// A shape placed in the world. What rays need of it is worked out once.
class Shape {
 public:
  /// @param sizes  a, b, c of the kind.  @param centre  world position of the origin of the shape's frame.
  Shape(ShapeKind kind, Vec3d sizes, Vec3d centre, const Mat3d& world_from_shape = Mat3d::identity());

  [[nodiscard]] ShapeKind kind() const { return kind_; }
  [[nodiscard]] Vec3d sizes() const { return sizes_; }
  [[nodiscard]] Vec3d centre() const { return centre_; }
  /// A world position in the shape's frame: where textures live.
  [[nodiscard]] Vec3d local(Vec3d world) const { return shape_from_world_ * (world - centre_); }
  [[nodiscard]] Vec3d local_direction(Vec3d world) const { return shape_from_world_ * world; }
  [[nodiscard]] Vec3d world_direction(Vec3d local) const { return world_from_shape_ * local; }
  /// False for rays that surely miss: their line passes by the bounding sphere, or meets it outside (t_min, t_max).
  [[nodiscard]] bool may_meet(const Ray& ray, double t_min, double t_max) const {
    const Vec3d from_centre = ray.origin - centre_;
    const double along = dot(from_centre, ray.direction);
    return dot(from_centre, from_centre) - along * along <= radius_ * radius_ && radius_ - along >= t_min &&
           -along - radius_ <= t_max;
  }

 private:
  ShapeKind kind_;
  Vec3d sizes_, centre_;
  Mat3d world_from_shape_, shape_from_world_;
  double radius_;  ///< of a sphere around the centre that holds the shape
};

/// The nearest entry with t in (t_min, t_max), or nothing. Loops ask `may_meet` before: it is cheap, and inlined there.
[[nodiscard]] std::optional<SurfaceHit> intersect(const Shape& shape, const Ray& ray, double t_min, double t_max);

}  // namespace cnerf::sample
