#include "bake/mesh/uv/planar_triangles.h"

#include <algorithm>
#include <cmath>

namespace cnerf::bake {
namespace {

PlanarTriangle shrunk(const PlanarTriangle& t) {
  constexpr float kShrink = 1e-3f;
  const Point2 middle = (t[0] + t[1] + t[2]) * (1.0f / 3);
  PlanarTriangle result;
  for (int corner = 0; corner < 3; ++corner) result[corner] = t[corner] + (middle - t[corner]) * kShrink;
  return result;
}

/// Whether an edge of `a` has all of `b` on its far side (separating axis theorem).
bool an_edge_separates(const PlanarTriangle& a, const PlanarTriangle& b) {
  for (int corner = 0; corner < 3; ++corner) {
    const Point2 edge = a[(corner + 1) % 3] - a[corner];
    Point2 outward{edge.y, -edge.x};
    if (dot(outward, a[(corner + 2) % 3] - a[corner]) > 0) outward = outward * -1.0f;
    const auto is_beyond = [&](Point2 p) { return dot(outward, p - a[corner]) >= 0; };
    if (is_beyond(b[0]) && is_beyond(b[1]) && is_beyond(b[2])) return true;
  }
  return false;
}

}  // namespace

bool overlap(const PlanarTriangle& a, const PlanarTriangle& b) {
  const PlanarTriangle small_a = shrunk(a), small_b = shrunk(b);
  return !an_edge_separates(small_a, small_b) && !an_edge_separates(small_b, small_a);
}

PlanarTriangles::Buckets PlanarTriangles::buckets_of(const PlanarTriangle& t) const {
  const auto bucket = [&](float value) { return std::int32_t(std::floor(value / cell_)); };
  return {bucket(std::min({t[0].x, t[1].x, t[2].x})), bucket(std::min({t[0].y, t[1].y, t[2].y})),
          bucket(std::max({t[0].x, t[1].x, t[2].x})), bucket(std::max({t[0].y, t[1].y, t[2].y}))};
}

bool PlanarTriangles::fits(const PlanarTriangle& triangle) const {
  const Buckets range = buckets_of(triangle);
  for (std::int32_t x = range.x0; x <= range.x1; ++x) {
    for (std::int32_t y = range.y0; y <= range.y1; ++y) {
      const auto bucket = buckets_.find(key(x, y));
      if (bucket == buckets_.end()) continue;
      for (const std::uint32_t other : bucket->second) {
        if (overlap(triangle, triangles_[other])) return false;
      }
    }
  }
  return true;
}

void PlanarTriangles::add(const PlanarTriangle& triangle) {
  const auto index = std::uint32_t(triangles_.size());
  triangles_.push_back(triangle);
  const Buckets range = buckets_of(triangle);
  for (std::int32_t x = range.x0; x <= range.x1; ++x) {
    for (std::int32_t y = range.y0; y <= range.y1; ++y) buckets_[key(x, y)].push_back(index);
  }
}

}  // namespace cnerf::bake
