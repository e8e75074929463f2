#include "bake/mesh/surface/isosurface.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <cmath>

namespace cnerf::bake {
namespace {

/// Share of light taken by `depth` voxels, at voxel centres.
openvdb::FloatGrid::Ptr opacity_grid(const BrickGrid<float>& sigma, double voxel_size, double depth) {
  auto grid = openvdb::FloatGrid::create(0.0f);
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  auto accessor = grid->getAccessor();
  const auto path = float(voxel_size * depth);
  for (std::size_t b = 0; b < sigma.brick_count(); ++b) {
    if (!sigma.has_brick(b)) continue;
    const Vec3i low = sigma.brick_min(b);
    const auto& values = sigma.brick(b);
    for (int offset = 0; offset < kBrickVoxels; ++offset) {
      if (values[offset] <= 0) continue;
      const Vec3i at = low + brick_local(offset);
      accessor.setValue({at.x, at.y, at.z}, -std::expm1(-values[offset] * path));
    }
  }
  openvdb::tools::dilateActiveValues(grid->tree(), 1);  // the surface may pass between a voxel and an empty one
  return grid;
}

float squared_distance(const SurfaceMesh& mesh, std::uint32_t a, std::uint32_t b) {
  const Vec3f d = mesh.positions[a] - mesh.positions[b];
  return dot(d, d);
}

void add_quad(SurfaceMesh& mesh, const openvdb::Vec4I& q) {
  if (squared_distance(mesh, q[0], q[2]) <= squared_distance(mesh, q[1], q[3])) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  } else {
    mesh.triangles.push_back({q[0], q[1], q[3]});
    mesh.triangles.push_back({q[1], q[2], q[3]});
  }
}

}  // namespace

SurfaceMesh extract_surface(const BrickGrid<float>& sigma, double voxel_size, double depth, double adaptivity) {
  openvdb::initialize();
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(*opacity_grid(sigma, voxel_size, depth), points, triangles, quads, 0.5, adaptivity);

  SurfaceMesh mesh;
  mesh.positions.reserve(points.size());
  // OpenVDB's index space has voxel ijk's value at ijk, ours at its centre.
  for (const openvdb::Vec3s& p : points) mesh.positions.push_back({p.x() + 0.5f, p.y() + 0.5f, p.z() + 0.5f});
  for (const openvdb::Vec3I& t : triangles) mesh.triangles.push_back({t[0], t[1], t[2]});
  for (const openvdb::Vec4I& q : quads) add_quad(mesh, q);
  // Its faces turn clockwise when seen from where the value is below the level.
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  compact(mesh);
  return mesh;
}

}  // namespace cnerf::bake
