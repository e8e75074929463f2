#include "bake/density/levels.h"

#include <algorithm>

#include "bake/density/density_pass.h"
#include "bake/progress.h"
#include "src/base/error.h"
#include "src/base/parallel.h"

namespace cnerf::bake {
namespace {

/// Share of a neighbour, one step away along each axis that is not 0, in the mean of what is interpolated in a voxel.
double share_of(Vec3i step) {
  double share = 1;
  for (int axis = 0; axis < 3; ++axis) share *= step[axis] == 0 ? 0.75 : 0.125;
  return share;
}

}  // namespace

std::size_t plane_count(std::span<const Level> levels) {
  std::size_t planes = 0;
  for (const Level& level : levels) planes += std::size_t(plane_count(level.plan));
  return planes;
}

std::size_t planes_at_a_time(const Options& options) {
  constexpr int kThreadsOfPlane = 4, kMost = 4;
  if (!options.max_memory.empty()) return 1;
  return std::size_t(std::clamp(thread_count() / kThreadsOfPlane, 1, kMost));
}

// The journal's parts are the planes of the density pass, level by level, then those of the radiance pass.

std::vector<Level> bake_levels(const ColorField& field, const std::vector<Plan>& plans, const Options& options,
                               Journal& journal, const ProgressSink& sink) {
  std::vector<Level> levels;
  for (const Plan& plan : plans) levels.push_back({plan, empty_density(plan)});
  const PassProgress progress = volume_progress(sink, 0, kDensityPassShare);
  const std::size_t all = plane_count(levels);
  std::size_t done = 0;
  std::size_t first = 0;
  bool any = false;
  for (Level& level : levels) {
    const auto planes = std::size_t(plane_count(level.plan));
    journal.parts<DenseVoxel>(
        first, planes, planes_at_a_time(options),
        [&](std::size_t plane) { return bake_density_plane(field, level.plan, options, int(plane)); },
        [&](std::size_t plane, const std::vector<DenseVoxel>& voxels) {
          put_plane(voxels, int(plane), level.sigma);
          any = any || !voxels.empty();
          progress.report(double(++done) / double(all));
        },
        [&](std::size_t, const std::vector<DenseVoxel>& voxels) { return is_plane_of(level.plan, voxels); });
    first += planes;
  }
  if (!any) throw InputError("bake: no voxel is as opaque as opacity_threshold; lower it, or check --aabb");
  return levels;
}

float sharpened_density(const Level& level, Vec3i voxel, double strength) {
  const Plan& plan = level.plan;
  const float own = level.sigma.at(voxel);
  double brought = 0;
  for (int neighbour = 0; neighbour < 27; ++neighbour) {
    const Vec3i step{neighbour / 9 - 1, neighbour / 3 % 3 - 1, neighbour % 3 - 1};
    const Vec3i at = voxel + step;
    const Vec3d middle = plan.world_from_voxel(at.cast<double>() + Vec3d{0.5, 0.5, 0.5});
    if (plan.in_hole(at) || !plan.box.contains(middle)) continue;
    brought += share_of(step) * (double(level.sigma.at(at)) - own);
  }
  return std::max(0.0f, own - float(strength * std::max(0.0, brought)));
}

}  // namespace cnerf::bake
