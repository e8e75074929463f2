#include "bake/mesh/surface/surface_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "src/base/aabb.h"

namespace cnerf::bake {
namespace {

constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();

float angle_between(Vec3f a, Vec3f b) {
  const float product = length(a) * length(b);
  return product > 0 ? std::acos(std::clamp(dot(a, b) / product, -1.0f, 1.0f)) : 0.0f;
}

/// Union-find with path halving.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  [[nodiscard]] std::uint32_t root(std::uint32_t x) {
    while (parent_[x] != x) x = parent_[x] = parent_[parent_[x]];
    return x;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

Aabbf box_of(const SurfaceMesh& mesh) {
  Aabbf box = Aabbf::empty();
  for (const Vec3f& p : mesh.positions) box.grow(p);
  return box;
}

float diagonal(const SurfaceMesh& mesh) {
  return mesh.positions.empty() ? 0.0f : length(box_of(mesh).size());
}

/// Whether a closed surface has the point inside, whichever way it faces: by its winding number, from the solid angles
/// of its triangles (van Oosterom and Strackee 1983).
bool surrounds(const SurfaceMesh& mesh, Vec3f point) {
  if (!box_of(mesh).contains(point)) return false;
  double angle = 0;
  for (const Triangle& t : mesh.triangles) {
    const auto corner = [&](int c) { return (mesh.positions[t[c]] - point).cast<double>(); };
    const Vec3d a = corner(0), b = corner(1), c = corner(2);
    const double la = length(a), lb = length(b), lc = length(c);
    angle += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return std::abs(angle) > 2 * std::numbers::pi;  // half a turn around it
}

void append(SurfaceMesh& to, const SurfaceMesh& part) {
  const auto first = std::uint32_t(to.positions.size());
  to.positions.insert(to.positions.end(), part.positions.begin(), part.positions.end());
  for (const Triangle& t : part.triangles) to.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

/// Moves every vertex by `step` of the way to the mean of its neighbours.
void relax(SurfaceMesh& mesh, float step) {
  std::vector<Vec3f> sum(mesh.positions.size());
  std::vector<float> neighbours(mesh.positions.size(), 0);
  for (const Triangle& t : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      sum[t[corner]] += mesh.positions[t[(corner + 1) % 3]] + mesh.positions[t[(corner + 2) % 3]];
      neighbours[t[corner]] += 2;
    }
  }
  for (std::size_t v = 0; v < sum.size(); ++v) {
    if (neighbours[v] > 0) mesh.positions[v] += (sum[v] / neighbours[v] - mesh.positions[v]) * step;
  }
}

}  // namespace

std::vector<Vec3f> vertex_normals(const SurfaceMesh& mesh) {
  std::vector<Vec3f> normals(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    const Vec3f normal = face_normal(mesh, t);
    for (int corner = 0; corner < 3; ++corner) {
      const Vec3f& at = mesh.positions[t[corner]];
      const Vec3f to_next = mesh.positions[t[(corner + 1) % 3]] - at;
      const Vec3f to_previous = mesh.positions[t[(corner + 2) % 3]] - at;
      normals[t[corner]] += normal * angle_between(to_next, to_previous);
    }
  }
  for (Vec3f& normal : normals) {
    const float size = length(normal);
    normal = size > 0 ? normal / size : Vec3f{0, 0, 1};
  }
  return normals;
}

double signed_volume(const SurfaceMesh& mesh) {
  double volume = 0;
  for (const Triangle& t : mesh.triangles) {
    const auto corner = [&](int c) { return mesh.positions[t[c]].cast<double>(); };
    volume += dot(corner(0), cross(corner(1), corner(2))) / 6;
  }
  return volume;
}

void compact(SurfaceMesh& mesh) {
  std::erase_if(mesh.triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  std::vector<std::uint32_t> renamed(mesh.positions.size(), kUnused);
  for (const Triangle& t : mesh.triangles) {
    for (const std::uint32_t vertex : t) renamed[vertex] = 0;
  }
  std::uint32_t used = 0;
  for (std::size_t v = 0; v < renamed.size(); ++v) {
    if (renamed[v] == kUnused) continue;
    mesh.positions[used] = mesh.positions[v];
    renamed[v] = used++;
  }
  mesh.positions.resize(used);
  for (Triangle& t : mesh.triangles) {
    for (std::uint32_t& vertex : t) vertex = renamed[vertex];
  }
}

std::vector<SurfaceMesh> connected_parts(const SurfaceMesh& mesh) {
  DisjointSets sets(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    sets.join(t[0], t[1]);
    sets.join(t[0], t[2]);
  }
  std::vector<std::uint32_t> part_of_root(mesh.positions.size(), kUnused), renamed(mesh.positions.size(), kUnused);
  std::vector<SurfaceMesh> parts;
  for (Triangle t : mesh.triangles) {
    std::uint32_t& part = part_of_root[sets.root(t[0])];
    if (part == kUnused) {
      part = std::uint32_t(parts.size());
      parts.emplace_back();
    }
    for (std::uint32_t& vertex : t) {
      if (renamed[vertex] == kUnused) {
        renamed[vertex] = std::uint32_t(parts[part].positions.size());
        parts[part].positions.push_back(mesh.positions[vertex]);
      }
      vertex = renamed[vertex];
    }
    parts[part].triangles.push_back(t);
  }
  return parts;
}

SurfaceMesh without_loose_parts(const SurfaceMesh& mesh, double smallest, std::span<const Vec3f> seen_from) {
  const std::vector<SurfaceMesh> parts = connected_parts(mesh);
  const auto least = float(smallest * diagonal(mesh));
  const auto largest = std::max_element(
      parts.begin(), parts.end(), [](const SurfaceMesh& a, const SurfaceMesh& b) { return diagonal(a) < diagonal(b); });
  SurfaceMesh solids, rooms, around;
  for (auto part = parts.begin(); part != parts.end(); ++part) {
    const bool is_cavity = signed_volume(*part) < 0;
    if (part != largest && diagonal(*part) < least) continue;
    const auto is_around = [&](Vec3f camera) { return surrounds(*part, camera); };
    if (is_cavity && part != largest) {
      if (std::ranges::any_of(seen_from, is_around)) append(rooms, *part);
    } else {
      append(!seen_from.empty() && std::ranges::all_of(seen_from, is_around) ? around : solids, *part);
    }
  }
  append(solids, rooms.triangles.empty() ? around : rooms);
  return solids;
}

void smooth(SurfaceMesh& mesh, int rounds) {
  constexpr float kShrink = 0.5f, kGrow = -0.53f;
  for (int round = 0; round < rounds; ++round) {
    relax(mesh, kShrink);
    relax(mesh, kGrow);
  }
}

SurfaceMesh decimated(const SurfaceMesh& mesh, int faces) {
  if (mesh.triangles.size() <= std::size_t(faces)) return mesh;
  constexpr float kAnyError = 1e9f;
  SurfaceMesh result;
  result.positions = mesh.positions;
  result.triangles.resize(mesh.triangles.size());
  const std::size_t indices = meshopt_simplify(
      result.triangles.data()->data(), mesh.triangles.data()->data(), 3 * mesh.triangles.size(),
      &mesh.positions.data()->x, mesh.positions.size(), sizeof(Vec3f), 3 * std::size_t(faces), kAnyError, 0, nullptr);
  result.triangles.resize(indices / 3);
  compact(result);
  return result;
}

}  // namespace cnerf::bake
