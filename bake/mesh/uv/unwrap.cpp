#include "bake/mesh/uv/unwrap.h"

#include <unordered_map>

#include "bake/mesh/uv/atlas.h"

namespace cnerf::bake {
namespace {

std::vector<std::vector<PlanarTriangle>> projected(const SurfaceMesh& mesh, const std::vector<UvChart>& charts) {
  std::vector<std::vector<PlanarTriangle>> planar;
  for (const UvChart& chart : charts) {
    planar.emplace_back();
    for (const std::uint32_t face : chart.faces) {
      PlanarTriangle t;
      for (int corner = 0; corner < 3; ++corner) {
        t[corner] = chart.plane.project(mesh.positions[mesh.triangles[face][corner]]);
      }
      planar.back().push_back(t);
    }
  }
  return planar;
}

}  // namespace

UnwrappedMesh unwrap(const SurfaceMesh& mesh, int size, int gutter) {
  const std::vector<UvChart> charts = make_charts(mesh);
  const Atlas atlas = pack_charts(projected(mesh, charts), size, gutter);
  const std::vector<Vec3f> normals = vertex_normals(mesh);

  UnwrappedMesh result;
  result.size = size;
  result.charts = int(charts.size());
  for (std::size_t c = 0; c < charts.size(); ++c) {
    std::unordered_map<std::uint32_t, std::uint32_t> copies;  // vertex -> its copy in this chart
    for (const std::uint32_t face : charts[c].faces) {
      Triangle triangle{};
      for (int corner = 0; corner < 3; ++corner) {
        const std::uint32_t vertex = mesh.triangles[face][corner];
        const auto [copy, is_new] = copies.try_emplace(vertex, std::uint32_t(result.texels.size()));
        if (is_new) {
          const Vec3f& position = mesh.positions[vertex];
          result.mesh.positions.push_back(position);
          result.normals.push_back(normals[vertex]);
          result.texels.push_back(atlas.texel(atlas.placements[c], charts[c].plane.project(position)));
        }
        triangle[corner] = copy->second;
      }
      result.mesh.triangles.push_back(triangle);
      result.chart.push_back(std::uint32_t(c));
    }
  }
  return result;
}

}  // namespace cnerf::bake
