#include "bake/mesh/mesh_baker.h"

#include "bake/bake_plan.h"
#include "bake/density_pass.h"
#include "bake/mesh/isosurface.h"
#include "bake/mesh/refine.h"
#include "bake/mesh/solidify.h"
#include "bake/mesh/texture_baker.h"
#include "src/base/error.h"

namespace cnerf {
namespace {

constexpr double kDensityShare = 0.25, kSurfaceShare = 0.35;

/// Maps the shares of the steps onto one progress line, and stops on Ctrl-C.
class MeshProgress {
 public:
  explicit MeshProgress(const ProgressSink& sink) : sink_(sink) {}

  [[nodiscard]] std::function<void(double)> step(double begin, double end) const {
    return [this, begin, end](double share) {
      if (interruption_requested()) throw Interrupted("bake stopped: the mesh was not written, run it again");
      if (sink_) sink_({"mesh", begin + (end - begin) * share, {}});
    };
  }

 private:
  const ProgressSink& sink_;
};

SurfaceMesh make_surface(const BrickGrid<float>& sigma, const BakePlan& plan, const MeshOptions& options) {
  SurfaceMesh surface = extract_surface(sigma, plan.voxel_size, options.surface_depth, options.adaptivity);
  if (surface.triangles.empty()) {
    throw InputError("mesh: nothing is opaque enough to have a surface; raise mesh.surface_depth, or check --aabb");
  }
  surface = without_loose_parts(surface, options.smallest_part);
  smooth(surface, options.smoothing);
  return decimated(surface, options.faces);
}

void put_into_world(const UnwrappedMesh& unwrapped, const BakePlan& plan, BakedMesh& mesh) {
  for (const Vec3f& p : unwrapped.mesh.positions) {
    mesh.positions.push_back(plan.world_from_voxel(p.cast<double>()).cast<float>());
  }
  mesh.normals = unwrapped.normals;
  mesh.triangles = unwrapped.mesh.triangles;
  const auto size = float(unwrapped.size);
  for (const Point2 texel : unwrapped.texels) mesh.uvs.push_back({texel.x / size, texel.y / size});
}

}  // namespace

BakedMesh bake_mesh(const ColorField& field, const std::vector<BakeCamera>& cameras, const BakeLevel& level,
                    const BakeOptions& bake, const MeshOptions& options, const ProgressSink& sink) {
  const MeshProgress progress(sink);
  const auto& [plan, sigma] = level;
  const SurfaceMesh surface = make_surface(solidified(sigma, cameras, plan, bake), plan, options);
  const UnwrappedMesh unwrapped = unwrap(surface, options.texture_size, options.gutter);
  progress.step(kDensityShare, kSurfaceShare)(1);

  BakedMesh mesh;
  put_into_world(unwrapped, plan, mesh);
  const TexelShader shader(field, cameras, plan, bake, options, sigma);
  mesh.texture = bake_texture(unwrapped, shader, options.gutter, progress.step(kSurfaceShare, 1));
  mesh.voxel_size = plan.voxel_size;
  mesh.charts = unwrapped.charts;
  mesh.gutter = options.gutter;
  mesh.frame = field.frame();
  return mesh;
}

BakedMesh bake_mesh(const ColorField& field, const std::vector<BakeCamera>& cameras, const BakeOptions& bake,
                    const MeshOptions& options, const ProgressSink& sink) {
  const MeshProgress progress(sink);
  const BakePlan plan = plan_bake(field, bake);
  const BakeLevel level{plan, bake_density(field, plan, bake, progress.step(0, kDensityShare))};
  return bake_mesh(field, cameras, level, bake, options, sink);
}

}  // namespace cnerf
