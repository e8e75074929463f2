#include "bake/mesh/surface/refine.h"

#include <meshoptimizer.h>

#include <algorithm>

#include "src/base/aabb.h"

namespace cnerf::bake {
namespace {

float diagonal(const SurfaceMesh& mesh) {
  Aabbf box = Aabbf::empty();
  for (const Vec3f& p : mesh.positions) box.grow(p);
  return mesh.positions.empty() ? 0.0f : length(box.size());
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

SurfaceMesh without_loose_parts(const SurfaceMesh& mesh, double smallest) {
  const std::vector<SurfaceMesh> parts = connected_parts(mesh);
  const auto least = float(smallest * diagonal(mesh));
  const auto largest = std::max_element(
      parts.begin(), parts.end(), [](const SurfaceMesh& a, const SurfaceMesh& b) { return diagonal(a) < diagonal(b); });
  SurfaceMesh kept;
  for (auto part = parts.begin(); part != parts.end(); ++part) {
    const bool is_cavity = signed_volume(*part) < 0;
    if (part == largest || (!is_cavity && diagonal(*part) >= least)) append(kept, *part);
  }
  return kept;
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
