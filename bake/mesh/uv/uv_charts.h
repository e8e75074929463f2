#pragma once
/// Cuts a surface into charts: patches flat enough to be laid into a plane without overlapping themselves.

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "bake/mesh/surface/surface_mesh.h"

namespace cnerf::bake {

struct Point2 {
  float x = 0, y = 0;
  friend bool operator==(const Point2&, const Point2&) = default;
};
using PlanarTriangle = std::array<Point2, 3>;

[[nodiscard]] inline Point2 operator+(Point2 a, Point2 b) {
  return {a.x + b.x, a.y + b.y};
}
[[nodiscard]] inline Point2 operator-(Point2 a, Point2 b) {
  return {a.x - b.x, a.y - b.y};
}
[[nodiscard]] inline Point2 operator*(Point2 a, float s) {
  return {a.x * s, a.y * s};
}
[[nodiscard]] inline float dot(Point2 a, Point2 b) {
  return a.x * b.x + a.y * b.y;
}

/// Twice the area, positive when the corners turn counter-clockwise.
[[nodiscard]] inline float signed_area(const PlanarTriangle& t) {
  return (t[1].x - t[0].x) * (t[2].y - t[0].y) - (t[1].y - t[0].y) * (t[2].x - t[0].x);
}

/// Whether the insides of two triangles meet. Sharing an edge or a corner is no overlap: both are first shrunk by a
/// thousandth towards their middles.
[[nodiscard]] bool overlap(const PlanarTriangle& a, const PlanarTriangle& b);

/// Takes triangles in as long as they do not overlap those inside, which a grid of buckets finds quickly.
class PlanarTriangles {
 public:
  /// @param cell  side of a bucket; about the size of a triangle.
  explicit PlanarTriangles(float cell) : cell_(cell) {}

  [[nodiscard]] bool fits(const PlanarTriangle& triangle) const;
  void add(const PlanarTriangle& triangle);

 private:
  struct Buckets {
    std::int32_t x0, y0, x1, y1;  ///< both inclusive
  };
  [[nodiscard]] Buckets buckets_of(const PlanarTriangle& triangle) const;
  [[nodiscard]] static std::uint64_t key(std::int32_t x, std::int32_t y) {
    return std::uint64_t(std::uint32_t(x)) << 32 | std::uint32_t(y);
  }

  float cell_;
  std::vector<PlanarTriangle> triangles_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> buckets_;
};

/// A plane with right-handed axes: u x v is the chart's normal.
struct ChartPlane {
  Vec3f u, v;
  [[nodiscard]] Point2 project(Vec3f p) const { return {dot(u, p), dot(v, p)}; }
  [[nodiscard]] Vec3f normal() const { return cross(u, v); }
};

struct UvChart {
  std::vector<std::uint32_t> faces;  ///< of the mesh
  ChartPlane plane;
};

/// Charts that together have every face of non-zero area exactly once. Within a chart no two projected faces overlap
/// and none is turned over. Same result in every call.
[[nodiscard]] std::vector<UvChart> make_charts(const SurfaceMesh& mesh);

}  // namespace cnerf::bake
