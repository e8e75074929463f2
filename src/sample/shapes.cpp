#include "src/sample/shapes.h"

#include <algorithm>
#include <cmath>

namespace cnerf::sample {
namespace {

struct Range {
  double min, max;
  [[nodiscard]] bool holds(double t) const { return t > min && t < max; }
};

/// Roots of a t^2 + 2 b t + c, the smaller one first.
struct Roots {
  double near, far;
};
std::optional<Roots> solve_quadratic(double a, double half_b, double c) {
  const double discriminant = half_b * half_b - a * c;
  if (discriminant < 0 || a == 0) return std::nullopt;
  const double root = std::sqrt(discriminant);
  return Roots{(-half_b - root) / a, (-half_b + root) / a};
}

using Hit = std::optional<SurfaceHit>;

Hit nearer(const Hit& p, const Hit& q) {
  if (!p) return q;
  if (!q) return p;
  return p->t <= q->t ? p : q;
}

Hit hit_sphere(const Ray& ray, Vec3d centre, double radius, Range range) {
  const Vec3d from_centre = ray.origin - centre;
  const auto roots =
      solve_quadratic(1, dot(from_centre, ray.direction), dot(from_centre, from_centre) - radius * radius);
  if (!roots || !range.holds(roots->near)) return std::nullopt;
  return SurfaceHit{roots->near, (from_centre + ray.direction * roots->near) / radius};
}

Hit hit_box(const Ray& ray, Vec3d half, Range range) {
  double enter = -INFINITY;
  double leave = INFINITY;
  Vec3d normal;
  for (int axis = 0; axis < 3; ++axis) {
    const double d = ray.direction[axis];
    const double o = ray.origin[axis];
    if (d == 0) {
      if (std::abs(o) > half[axis]) return std::nullopt;
      continue;
    }
    const double side = d > 0 ? -1 : 1;  // the face that is met first
    const double t = (side * half[axis] - o) / d;
    if (t > enter) {
      enter = t;
      normal = {};
      normal[axis] = side;
    }
    leave = std::min(leave, (-side * half[axis] - o) / d);
  }
  if (enter > leave || !range.holds(enter)) return std::nullopt;
  return SurfaceHit{enter, normal};
}

/// A disc across the z axis, met from the side its normal points to.
Hit hit_disc(const Ray& ray, double z, double radius, double normal_z, Range range) {
  if (ray.direction.z * normal_z >= 0) return std::nullopt;
  const double t = (z - ray.origin.z) / ray.direction.z;
  const Vec3d p = ray.origin + ray.direction * t;
  if (!range.holds(t) || p.x * p.x + p.y * p.y > radius * radius) return std::nullopt;
  return SurfaceHit{t, {0, 0, normal_z}};
}

Hit hit_tube(const Ray& ray, double radius, double half_height, Range range) {
  const Vec3d o = ray.origin;
  const Vec3d d = ray.direction;
  const auto roots =
      solve_quadratic(d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y, o.x * o.x + o.y * o.y - radius * radius);
  if (!roots || !range.holds(roots->near)) return std::nullopt;
  const Vec3d p = o + d * roots->near;
  if (std::abs(p.z) > half_height) return std::nullopt;
  return SurfaceHit{roots->near, {p.x / radius, p.y / radius, 0}};
}

Hit hit_cylinder(const Ray& ray, double radius, double half_height, Range range) {
  const Hit caps = nearer(hit_disc(ray, half_height, radius, 1, range), hit_disc(ray, -half_height, radius, -1, range));
  return nearer(caps, hit_tube(ray, radius, half_height, range));
}

Hit hit_capsule(const Ray& ray, double radius, double half_length, Range range) {
  const Hit ends =
      nearer(hit_sphere(ray, {0, 0, half_length}, radius, range), hit_sphere(ray, {0, 0, -half_length}, radius, range));
  return nearer(ends, hit_tube(ray, radius, half_length, range));
}

Hit hit_cone(const Ray& ray, double radius, double height, Range range) {
  const double slope = radius / height;  // x^2 + y^2 = slope^2 (height - z)^2
  const Vec3d o = {ray.origin.x, ray.origin.y, height - ray.origin.z};
  const Vec3d d = {ray.direction.x, ray.direction.y, -ray.direction.z};
  const double s = slope * slope;
  const auto roots = solve_quadratic(d.x * d.x + d.y * d.y - s * d.z * d.z, o.x * d.x + o.y * d.y - s * o.z * d.z,
                                     o.x * o.x + o.y * o.y - s * o.z * o.z);
  Hit best = hit_disc(ray, 0, radius, -1, range);
  if (!roots) return best;
  for (const double t : {roots->near, roots->far}) {
    const Vec3d p = ray.origin + ray.direction * t;
    if (!range.holds(t) || p.z < 0 || p.z > height) continue;
    const Vec3d normal = normalized(Vec3d{p.x, p.y, slope * std::sqrt(p.x * p.x + p.y * p.y)});
    if (dot(normal, ray.direction) < 0) best = nearer(best, SurfaceHit{t, normal});
  }
  return best;
}

double torus_distance(Vec3d p, double ring, double tube) {
  const double off_ring = std::sqrt(p.x * p.x + p.y * p.y) - ring;
  return std::sqrt(off_ring * off_ring + p.z * p.z) - tube;
}

/// By walking along the ray in steps of the distance to the surface: simpler than a quartic, and robust.
Hit hit_torus(const Ray& ray, double ring, double tube, Range range) {
  const double radius = ring + tube;
  const auto roots = solve_quadratic(1, dot(ray.origin, ray.direction), dot(ray.origin, ray.origin) - radius * radius);
  if (!roots) return std::nullopt;
  double t = std::max(range.min, roots->near);
  const double end = std::min(range.max, roots->far);
  for (int step = 0; step < 96 && t < end; ++step) {
    const Vec3d p = ray.origin + ray.direction * t;
    const double distance = torus_distance(p, ring, tube);
    if (distance < 1e-6) {
      const double across = std::sqrt(p.x * p.x + p.y * p.y);
      const double toward_ring = 1 - ring / across;
      const Vec3d normal = normalized(Vec3d{p.x * toward_ring, p.y * toward_ring, p.z});
      // A ray that starts on the surface and leaves it has not hit it.
      if (dot(normal, ray.direction) < 0 && range.holds(t)) return SurfaceHit{t, normal};
      t += 1e-4;
    }
    t += std::max(distance, 1e-7);
  }
  return std::nullopt;
}

Hit hit_local(const Shape& shape, const Ray& ray, Range range) {
  const auto [a, b, c] = shape.sizes();
  switch (shape.kind()) {
    case ShapeKind::kSphere:
      return hit_sphere(ray, {}, a, range);
    case ShapeKind::kBox:
      return hit_box(ray, {a, b, c}, range);
    case ShapeKind::kCylinder:
      return hit_cylinder(ray, a, b, range);
    case ShapeKind::kCone:
      return hit_cone(ray, a, b, range);
    case ShapeKind::kCapsule:
      return hit_capsule(ray, a, b, range);
    case ShapeKind::kTorus:
      return hit_torus(ray, a, b, range);
  }
  return std::nullopt;
}

double bounding_radius(ShapeKind kind, Vec3d sizes) {
  const auto [a, b, c] = sizes;
  switch (kind) {
    case ShapeKind::kSphere:
      return a;
    case ShapeKind::kBox:
      return length(sizes);
    case ShapeKind::kCylinder:
      return std::sqrt(a * a + b * b);
    case ShapeKind::kCone:
      return std::max(a, b);
    case ShapeKind::kCapsule:
    case ShapeKind::kTorus:
      return a + b;
  }
  return 0;
}

}  // namespace

Shape::Shape(ShapeKind kind, Vec3d sizes, Vec3d centre, const Mat3d& world_from_shape)
    : kind_(kind),
      sizes_(sizes),
      centre_(centre),
      world_from_shape_(world_from_shape),
      shape_from_world_(world_from_shape.transposed()),
      radius_(bounding_radius(kind, sizes)) {}

std::optional<SurfaceHit> intersect(const Shape& shape, const Ray& ray, double t_min, double t_max) {
  std::optional<SurfaceHit> hit =
      hit_local(shape, {shape.local(ray.origin), shape.local_direction(ray.direction)}, {t_min, t_max});
  if (hit) hit->normal = shape.world_direction(hit->normal);
  return hit;
}

}  // namespace cnerf::sample
