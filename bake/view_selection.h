#pragma once
/// Which cameras see a point of a baked density grid.

#include <vector>

#include "bake/bake_camera.h"
#include "bake/bake_plan.h"
#include "bake/brick_grid.h"

namespace cnerf {

/// Transmittance between two points in voxel coordinates (voxel ijk covers [ijk, ijk + 1)), by steps of one voxel with
/// nearest-neighbour densities. The first voxel's length after `from` is left out: a surface must not hide itself.
/// @param voxel_size  world units.  @return in [0, 1]; 0 once it falls below `stop_below`.
[[nodiscard]] float transmittance_between(const BrickGrid<float>& sigma, double voxel_size, Vec3f from, Vec3f to,
                                          float stop_below);

/// A camera and how much of a point's light reaches it.
struct SeenBy {
  int camera = 0;
  float transmittance = 0;
};

/// Answers "who sees this voxel" for the cameras of a bake. Immutable; thread-safe.
class ViewSelection {
 public:
  ViewSelection(const std::vector<BakeCamera>& cameras, const BakePlan& plan, const BakeOptions& options);

  /// Order in which cameras are worth trying for points around `world`: first the one with the finest pixels there,
  /// then always the one farthest, in direction, from those before it; so a few cameras already surround the point.
  [[nodiscard]] std::vector<int> try_order(Vec3d world) const;

  /// Light also has to pass this grid, of another level of the same bake; both must outlive this object.
  void look_through(const BrickGrid<float>& sigma, const BakePlan& plan) { others_.push_back({&sigma, &plan}); }

  /// At most `views_per_voxel` cameras that have the point in their picture and see it, best first.
  /// @param least  transmittance below which a camera does not count, if above `seen_transmittance`.
  [[nodiscard]] std::vector<SeenBy> seen_by(const BrickGrid<float>& sigma, Vec3d world, const std::vector<int>& order,
                                            float least = 0) const;

  /// Unit direction from a camera to a point.
  [[nodiscard]] Vec3f direction_to(int camera, Vec3d world) const;

 private:
  struct Eye {
    Intrinsics intrinsics;
    Affined camera_from_world;
    Vec3d centre;  // world
  };
  struct Level {
    const BrickGrid<float>* sigma;
    const BakePlan* plan;
  };
  [[nodiscard]] bool has_in_picture(const Eye& eye, Vec3d world) const;
  [[nodiscard]] float transmittance_to(const Eye& eye, const BrickGrid<float>& sigma, Vec3d world, float least) const;

  std::vector<Eye> eyes_;
  std::vector<Level> others_;
  BakePlan plan_;
  int views_per_voxel_;
  float seen_transmittance_;
};

}  // namespace cnerf
