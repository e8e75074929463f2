#include "bake/mesh/surface/isosurface.h"

#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <cmath>

#include "bake/density/density_pass.h"
#include "bake/visibility/view_selection.h"
#include "bake/volume/openvdb_grids.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

constexpr float kBlocked = 0.05f;  ///< less light than this does not count as a way out
constexpr int kOpenWays = 5;       ///< as many ways out make a place open

/// Upwards first: most of what is not hidden is open that way.
std::vector<Vec3f> ways_out() {
  std::vector<Vec3f> ways;
  for (int z = 1; z >= -1; --z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        if (x != 0 || y != 0 || z != 0) ways.push_back(Vec3i{x, y, z}.cast<float>());
      }
    }
  }
  std::stable_sort(ways.begin(), ways.end(), [](Vec3f a, Vec3f b) { return dot(a, a) < dot(b, b); });
  return ways;
}

class HiddenVoxels {
 public:
  HiddenVoxels(const BrickGrid<float>& sigma, const std::vector<Camera>& cameras, const Plan& plan,
               const Options& options)
      : sigma_(sigma), plan_(plan), views_(cameras, {{&sigma, plan.origin, plan.voxel_size}}, one_view(options)) {}

  /// Which voxels of a brick are hidden, by their offset.
  [[nodiscard]] std::vector<int> of_brick(std::size_t brick) const {
    const Vec3i low = sigma_.brick_min(brick);
    std::vector<std::int32_t> order;  // of cameras, once for the brick and only if needed
    std::vector<int> hidden;
    for (int offset = 0; offset < kBrickVoxels; ++offset) {
      const Vec3i voxel = low + brick_local(offset);
      if (!sigma_.contains(voxel)) continue;
      const Vec3f centre = voxel.cast<float>() + Vec3f{0.5f, 0.5f, 0.5f};
      if (is_open(centre)) continue;
      const Vec3d world = plan_.world_from_voxel(centre.cast<double>());
      if (order.empty()) order = try_order(views_.eyes(), world);
      if (views_.seen_by(0, world, order).empty()) hidden.push_back(offset);
    }
    return hidden;
  }

 private:
  static Options one_view(Options options) {
    options.views_per_voxel = 1;
    return options;
  }
  [[nodiscard]] bool is_open(Vec3f from) const {
    static const std::vector<Vec3f> kWays = ways_out();
    const auto far = float(2 * (sigma_.size().x + sigma_.size().y + sigma_.size().z));
    int open = 0;
    for (const Vec3f way : kWays) {
      open += transmittance_between(sigma_, plan_.voxel_size, from, from + way * far, kBlocked) > 0 ? 1 : 0;
      if (open == kOpenWays) return true;
    }
    return false;
  }

  const BrickGrid<float>& sigma_;
  const Plan& plan_;
  ViewSelection views_;
};

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

BrickGrid<float> solidified(const BrickGrid<float>& sigma, const std::vector<Camera>& cameras, const Plan& plan,
                            const Options& options) {
  const HiddenVoxels hidden(sigma, cameras, plan, options);
  const std::vector<char> near_matter = bricks_with_neighbours(sigma);
  const auto opaque = float(max_sigma(plan.voxel_size));
  BrickGrid<float> solid(sigma.min(), sigma.size(), 0.0f);
  parallel_tasks(sigma.brick_count(), [&](std::size_t brick) {
    if (!near_matter[brick]) return;
    const std::vector<int> offsets = hidden.of_brick(brick);
    if (!sigma.has_brick(brick) && offsets.empty()) return;
    auto& values = solid.make_brick(brick);
    if (sigma.has_brick(brick)) values = sigma.brick(brick);
    for (const int offset : offsets) values[offset] = opaque;
  });
  return solid;
}

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
