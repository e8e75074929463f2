#include "bake/density/sharpen.h"

#include <algorithm>

namespace cnerf::bake {
namespace {

/// Share of a neighbour, one step away along each axis that is not 0, in the mean of what is interpolated in a voxel.
double share_of(Vec3i step) {
  double share = 1;
  for (int axis = 0; axis < 3; ++axis) share *= step[axis] == 0 ? 0.75 : 0.125;
  return share;
}

}  // namespace

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
