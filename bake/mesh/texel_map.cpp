#include "bake/mesh/texel_map.h"

#include <algorithm>
#include <cmath>

namespace cnerf {
namespace {

/// Shares of the three corners at a point of a triangle; all non-negative inside it.
struct Shares {
  double a = 0, b = 0, c = 0;
  [[nodiscard]] bool inside() const { return a >= 0 && b >= 0 && c >= 0; }
};

class TriangleShares {
 public:
  explicit TriangleShares(const PlanarTriangle& t) : t_(t) {
    area_ = cross_of(t[0], t[1], {t[2].x, t[2].y});
  }
  [[nodiscard]] bool has_area() const { return area_ != 0; }
  [[nodiscard]] Shares at(double x, double y) const {
    const Position p{x, y};
    return {cross_of(t_[1], t_[2], p) / area_, cross_of(t_[2], t_[0], p) / area_, cross_of(t_[0], t_[1], p) / area_};
  }

 private:
  struct Position {
    double x, y;
  };
  /// Both triangles at an edge compute the same number up to its sign: the edge is always walked the same way.
  static double cross_of(Point2 from, Point2 to, Position p) {
    if (from.x > to.x || (from.x == to.x && from.y > to.y)) return -cross_of(to, from, p);
    return (double(to.x) - from.x) * (p.y - from.y) - (double(to.y) - from.y) * (p.x - from.x);
  }

  PlanarTriangle t_;
  double area_ = 0;
};

}  // namespace

std::vector<SurfaceTexel> surface_texels(const UnwrappedMesh& mesh) {
  const std::size_t size = static_cast<std::size_t>(mesh.size);
  std::vector<std::uint32_t> owner(size * size, 0);  // triangle + 1
  std::vector<SurfaceTexel> texels;
  for (std::size_t triangle = 0; triangle < mesh.mesh.triangles.size(); ++triangle) {
    const PlanarTriangle t = mesh.texture_triangle(triangle);
    const TriangleShares shares(t);
    if (!shares.has_area()) continue;
    const auto first = [&](float low) { return std::max(0, static_cast<int>(std::ceil(low - 0.5f))); };
    const auto last = [&](float high) { return std::min(mesh.size - 1, static_cast<int>(std::floor(high - 0.5f))); };
    const int x0 = first(std::min({t[0].x, t[1].x, t[2].x})), x1 = last(std::max({t[0].x, t[1].x, t[2].x}));
    const int y0 = first(std::min({t[0].y, t[1].y, t[2].y})), y1 = last(std::max({t[0].y, t[1].y, t[2].y}));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Shares s = shares.at(x + 0.5, y + 0.5);
        std::uint32_t& taken = owner[static_cast<std::size_t>(y) * size + static_cast<std::size_t>(x)];
        if (!s.inside() || taken != 0) continue;
        taken = static_cast<std::uint32_t>(triangle + 1);
        const Triangle& v = mesh.mesh.triangles[triangle];
        const auto blended = [&](const std::vector<Vec3f>& values) {
          return (values[v[0]].cast<double>() * s.a + values[v[1]].cast<double>() * s.b +
                  values[v[2]].cast<double>() * s.c).cast<float>();
        };
        const Vec3f normal = blended(mesh.normals);
        texels.push_back({x, y, static_cast<std::uint32_t>(triangle), blended(mesh.mesh.positions),
                          dot(normal, normal) > 1e-6f ? normalized(normal) : face_normal(mesh.mesh, v)});
      }
    }
  }
  std::sort(texels.begin(), texels.end(), [](const SurfaceTexel& a, const SurfaceTexel& b) {
    return a.row != b.row ? a.row < b.row : a.column < b.column;
  });
  return texels;
}

}  // namespace cnerf
