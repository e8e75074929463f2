#include "bake/mesh/bake_mesh.h"

#include <algorithm>

#include "bake/density/density_pass.h"
#include "bake/lattice/plan.h"
#include "bake/mesh/surface/isosurface.h"
#include "bake/mesh/surface/surface_mesh.h"
#include "bake/mesh/texture/texture_baker.h"
#include "bake/progress.h"
#include "src/base/error.h"

namespace cnerf::bake {
namespace {

constexpr double kAdaptivity = 0.02;        ///< how far flat parts are merged when the surface is extracted, of 1
constexpr int kGutter = 2;                  ///< texels around a chart that belong to no other
constexpr double kDensityShare = 0.25;      ///< of the progress line, when density is baked before
constexpr double kSurfaceShare = 2.0 / 15;  ///< of the rest

constexpr std::size_t kMostSeenFrom = 16;  // cameras that tell what is an inside

/// Centres of cameras all over the capture, voxel coordinates.
std::vector<Vec3f> centres_of(const std::vector<Camera>& cameras, const Plan& plan) {
  std::vector<Vec3f> centres;
  const std::size_t step = std::max<std::size_t>(1, (cameras.size() + kMostSeenFrom - 1) / kMostSeenFrom);
  for (std::size_t i = 0; i < cameras.size(); i += step) {
    centres.push_back(plan.voxel_from_world(cameras[i].world_from_camera.translation).cast<float>());
  }
  return centres;
}

SurfaceMesh make_surface(const BrickGrid<float>& sigma, const Plan& plan, const std::vector<Camera>& cameras,
                         const MeshOptions& options) {
  SurfaceMesh surface = extract_surface(sigma, plan.voxel_size, options.surface_depth, kAdaptivity);
  if (surface.triangles.empty()) {
    throw InputError("mesh: nothing is opaque enough to have a surface; raise mesh.surface_depth, or check --aabb");
  }
  surface = without_loose_parts(surface, options.smallest_part, centres_of(cameras, plan));
  smooth(surface, options.smoothing);
  return decimated(surface, options.faces);
}

void put_into_world(const UnwrappedMesh& unwrapped, const Plan& plan, Mesh& mesh) {
  for (const Vec3f& p : unwrapped.mesh.positions) {
    mesh.positions.push_back(plan.world_from_voxel(p.cast<double>()).cast<float>());
  }
  mesh.normals = unwrapped.normals;
  mesh.triangles = unwrapped.mesh.triangles;
  const auto size = float(unwrapped.size);
  for (const Point2 texel : unwrapped.texels) mesh.uvs.push_back({texel.x / size, texel.y / size});
}

}  // namespace

Mesh bake_mesh(const ColorField& field, const std::vector<Camera>& cameras, const Level& level, const Options& bake,
               const MeshOptions& options, const ProgressSink& sink) {
  const PassProgress progress(sink, "mesh", kDensityShare, 1,
                              "bake stopped: nothing was written, the same command goes on");
  const auto& [plan, sigma] = level;
  const SurfaceMesh surface = make_surface(solidified(sigma, cameras, plan, bake), plan, cameras, options);
  const UnwrappedMesh unwrapped = unwrap(surface, options.texture_size, kGutter);
  progress.report(kSurfaceShare);

  Mesh mesh;
  put_into_world(unwrapped, plan, mesh);
  const TexelShader shader(field, cameras, plan, bake, sigma);
  mesh.texture = bake_texture(unwrapped, shader, kGutter,
                              [&](double share) { progress.report(kSurfaceShare + (1 - kSurfaceShare) * share); });
  mesh.voxel_size = plan.voxel_size;
  mesh.charts = unwrapped.charts;
  mesh.gutter = kGutter;
  mesh.frame = field.frame();
  return mesh;
}

}  // namespace cnerf::bake
