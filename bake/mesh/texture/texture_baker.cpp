#include "bake/mesh/texture/texture_baker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "bake/color/point_color.h"
#include "src/base/parallel.h"
#include "src/color/colorspace_math.h"

namespace cnerf::bake {
namespace {

/// Shares of the three corners at a point of a triangle; all non-negative inside it.
struct Shares {
  double a = 0, b = 0, c = 0;
  [[nodiscard]] bool inside() const { return a >= 0 && b >= 0 && c >= 0; }
};

class TriangleShares {
 public:
  explicit TriangleShares(const PlanarTriangle& t) : t_(t), area_(cross_of(t[0], t[1], {t[2].x, t[2].y})) {}
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
  double area_;
};

/// The point of a segment that is nearest to `p`, as the share of the way.
double nearest_share(Point2 a, Point2 b, Point2 p) {
  const Point2 way = b - a;
  const double squared = dot(way, way);
  return squared > 0 ? std::clamp(dot(way, p - a) / squared, 0.0, 1.0) : 0.0;
}

/// Shares at the point of the triangle's rim nearest to `p`; nothing when it lies outside the texel around `p`.
std::optional<Shares> touched(const PlanarTriangle& t, Point2 p) {
  constexpr float kWithin = 0.499f;  // a chart that ends exactly between two texels does not touch the outer one
  std::optional<Shares> best;
  float least = kWithin;
  for (int corner = 0; corner < 3; ++corner) {
    const Point2 a = t[corner], b = t[(corner + 1) % 3];
    const double share = nearest_share(a, b, p);
    const Point2 offset = a + (b - a) * float(share) - p;
    const float distance = std::max(std::abs(offset.x), std::abs(offset.y));
    if (distance >= least) continue;
    least = distance;
    std::array<double, 3> shares{};
    shares[corner] = 1 - share;
    shares[(corner + 1) % 3] = share;
    best = {shares[0], shares[1], shares[2]};
  }
  return best;
}

/// Collects texels, each once.
class TexelCollector {
 public:
  explicit TexelCollector(const UnwrappedMesh& mesh) : mesh_(mesh), taken_(std::size_t(mesh.size) * mesh.size, 0) {}

  /// Texels of a triangle for which `shares_at(x, y)` has an answer; their centres are at most `margin` outside its
  /// box.
  template <typename SharesAt>
  void add(std::size_t triangle, float margin, const SharesAt& shares_at) {
    const PlanarTriangle t = mesh_.texture_triangle(triangle);
    const auto first = [&](float low) { return std::max(0, int(std::ceil(low - margin - 0.5f))); };
    const auto last = [&](float high) { return std::min(mesh_.size - 1, int(std::floor(high + margin - 0.5f))); };
    const int x0 = first(std::min({t[0].x, t[1].x, t[2].x})), x1 = last(std::max({t[0].x, t[1].x, t[2].x}));
    const int y0 = first(std::min({t[0].y, t[1].y, t[2].y})), y1 = last(std::max({t[0].y, t[1].y, t[2].y}));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        char& taken = taken_[std::size_t(y) * mesh_.size + x];
        if (taken != 0) continue;
        const std::optional<Shares> shares = shares_at(x + 0.5, y + 0.5);
        if (!shares) continue;
        taken = 1;
        texels_.push_back(texel(x, y, triangle, *shares));
      }
    }
  }

  [[nodiscard]] std::vector<SurfaceTexel> by_row() && {
    std::sort(texels_.begin(), texels_.end(), [](const SurfaceTexel& a, const SurfaceTexel& b) {
      return a.row != b.row ? a.row < b.row : a.column < b.column;
    });
    return std::move(texels_);
  }

 private:
  [[nodiscard]] SurfaceTexel texel(int x, int y, std::size_t triangle, const Shares& s) const {
    const Triangle& v = mesh_.mesh.triangles[triangle];
    const auto blended = [&](const std::vector<Vec3f>& values) {
      const Vec3d sum =
          values[v[0]].cast<double>() * s.a + values[v[1]].cast<double>() * s.b + values[v[2]].cast<double>() * s.c;
      return sum.cast<float>();
    };
    const Vec3f normal = blended(mesh_.normals);
    return {x, y, std::uint32_t(triangle), blended(mesh_.mesh.positions),
            dot(normal, normal) > 1e-6f ? normalized(normal) : face_normal(mesh_.mesh, v)};
  }

  const UnwrappedMesh& mesh_;
  std::vector<char> taken_;
  std::vector<SurfaceTexel> texels_;
};

constexpr int kTile = 32;               ///< texels along a side: what a task shades in one go
constexpr float kLeastOpacity = 0.02f;  ///< a ray that met less has no colour to speak of

/// Texels of each square tile of the texture; tiles are tasks.
std::vector<std::vector<SurfaceTexel>> tiles_of(const UnwrappedMesh& mesh) {
  const int across = (mesh.size + kTile - 1) / kTile;
  std::vector<std::vector<SurfaceTexel>> tiles(std::size_t(across) * across);
  for (const SurfaceTexel& texel : surface_texels(mesh)) {
    tiles[std::size_t(texel.row / kTile) * across + texel.column / kTile].push_back(texel);
  }
  // Neighbours in the tile may be of different charts: those of one triangle are close in space.
  for (auto& tile : tiles) {
    std::stable_sort(tile.begin(), tile.end(),
                     [](const SurfaceTexel& a, const SurfaceTexel& b) { return a.triangle < b.triangle; });
  }
  return tiles;
}

void put(Texture& texture, std::size_t at, const VoxelColor& color) {
  texture.rgb[at] = color.rgb;
  texture.luminance[at] = luminance_of(color.rgb);
  texture.a[at] = color.a;
  texture.b[at] = color.b;
}

void shade_tile(const std::vector<SurfaceTexel>& texels, const TexelShader& shader, Texture& texture) {
  std::vector<SurfacePoint> points;
  for (const SurfaceTexel& texel : texels) points.push_back({texel.position, texel.normal});
  const std::vector<SurfaceColor> colors = shader.shade(points);
  for (std::size_t t = 0; t < texels.size(); ++t) {
    if (colors[t].opacity < kLeastOpacity) continue;
    const VoxelColor color = voxel_color(colors[t].luminance, colors[t].chromaticity, shader.gain());
    const std::size_t at = std::size_t(texels[t].row) * texture.size + texels[t].column;
    put(texture, at, color);
    texture.coverage[at] = 1;
  }
}

/// A colour from a linear mean: Lab follows from it, so that all maps of a texel say the same.
VoxelColor color_of_mean(Vec3f rgb) {
  const bool is_grey = rgb.x == rgb.y && rgb.y == rgb.z;
  const Lab<float> lab = is_grey ? Lab<float>{} : lab_from_linear_rgb(rgb);
  return {rgb, lab.a, lab.b};
}

}  // namespace

std::vector<SurfaceTexel> surface_texels(const UnwrappedMesh& mesh) {
  TexelCollector collector(mesh);
  for (std::size_t triangle = 0; triangle < mesh.mesh.triangles.size(); ++triangle) {
    const TriangleShares shares(mesh.texture_triangle(triangle));
    if (!shares.has_area()) continue;
    collector.add(triangle, 0, [&](double x, double y) {
      const Shares at = shares.at(x, y);
      return at.inside() ? std::optional<Shares>(at) : std::nullopt;
    });
  }
  for (std::size_t triangle = 0; triangle < mesh.mesh.triangles.size(); ++triangle) {
    const PlanarTriangle t = mesh.texture_triangle(triangle);
    collector.add(triangle, 0.5f, [&](double x, double y) { return touched(t, {float(x), float(y)}); });
  }
  return std::move(collector).by_row();
}

void fill_in(Texture& texture, int reach) {
  const int size = texture.size;
  std::vector<std::uint8_t> known = texture.coverage;
  std::vector<std::size_t> front;  // texels that the last step reached
  Vec3d sum{};
  for (std::size_t at = 0; at < known.size(); ++at) {
    if (!known[at]) continue;
    front.push_back(at);
    sum += texture.rgb[at].cast<double>();
  }
  const Vec3f mean = front.empty() ? Vec3f{} : (sum / double(front.size())).cast<float>();

  const auto neighbours = [&](std::size_t at, const auto& visit) {
    const int x = int(at % size), y = int(at / size);
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int nx = x + dx, ny = y + dy;
        if (nx >= 0 && ny >= 0 && nx < size && ny < size) visit(std::size_t(ny) * size + nx);
      }
    }
  };
  for (int step = 0; step < reach; ++step) {
    std::vector<std::size_t> reached;
    for (const std::size_t from : front) {
      neighbours(from, [&](std::size_t at) {
        if (known[at]) return;
        known[at] = 2;  // reached in this step: not yet a source
        reached.push_back(at);
      });
    }
    std::sort(reached.begin(), reached.end());
    for (const std::size_t at : reached) {
      Vec3f colors{};
      float count = 0;
      neighbours(at, [&](std::size_t from) {
        if (known[from] != 1) return;
        colors += texture.rgb[from];
        ++count;
      });
      put(texture, at, color_of_mean(colors / count));
    }
    for (const std::size_t at : reached) known[at] = 1;
    front = std::move(reached);
  }
  for (std::size_t at = 0; at < known.size(); ++at) {
    if (!known[at]) put(texture, at, color_of_mean(mean));
  }
}

Texture bake_texture(const UnwrappedMesh& mesh, const TexelShader& shader, int reach,
                     const std::function<void(double)>& advance) {
  Texture texture;
  texture.size = mesh.size;
  const std::size_t texels = std::size_t(mesh.size) * mesh.size;
  texture.rgb.resize(texels);
  for (auto* map : {&texture.luminance, &texture.a, &texture.b}) map->resize(texels);
  texture.coverage.resize(texels);
  const auto tiles = tiles_of(mesh);
  constexpr std::size_t kBatches = 64;
  for (std::size_t batch = 0; batch < kBatches; ++batch) {
    const std::size_t begin = tiles.size() * batch / kBatches, end = tiles.size() * (batch + 1) / kBatches;
    parallel_tasks(end - begin, [&](std::size_t i) {
      if (!tiles[begin + i].empty()) shade_tile(tiles[begin + i], shader, texture);
    });
    advance(double(batch + 1) / kBatches);
  }
  fill_in(texture, reach);
  return texture;
}

}  // namespace cnerf::bake
