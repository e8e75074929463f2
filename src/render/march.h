#pragma once
/// Steps along a ray through occupied space.

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/base/aabb.h"
#include "src/base/host_device.h"
#include "src/render/occupancy_grid.h"
#include "src/render/ray.h"

namespace cnerf {

/// Step lengths grow with the distance, as pixels' footprints do: dt(t) = clamp(cone_angle t, dt_min, dt_max).
struct MarchSettings {
  float dt_min = 0;  ///< unit space
  float dt_max = 0;
  float cone_angle = 0;  ///< 0: constant steps
};

/// Length of the step at t.
[[nodiscard]] CNERF_HD inline float march_step(const MarchSettings& settings, float t) {
  const float dt = settings.cone_angle * t;
  return dt < settings.dt_min ? settings.dt_min : dt > settings.dt_max ? settings.dt_max : dt;
}

/// @param steps_per_box  across the innermost cascade; 1 / dt_min
/// @param cone_angle     used by scenes of several cascades; a single one has constant steps
[[nodiscard]] inline MarchSettings march_settings(int cascades, int steps_per_box, double cone_angle) {
  MarchSettings settings;
  settings.dt_min = std::ldexp(1.0f, 1 - cascades) / float(steps_per_box);
  settings.dt_max = cascades > 1 ? 1.0f / 64.0f : settings.dt_min;
  settings.cone_angle = cascades > 1 ? float(cone_angle) : 0.0f;
  return settings;
}

/// Walks one ray. `next` yields the occupied samples in order, so that the caller may stop at any time.
class RayMarcher {
 public:
  RayMarcher() = default;
  /// @param jitter  in [0, 1): shifts the whole lattice of samples by this share of a step.
  RayMarcher(const OccupancyGrid& grid, const MarchSettings& settings, const Ray& ray, float jitter)
      : grid_(&grid), settings_(settings), ray_(ray) {
    const auto inside = intersect(Aabbf{{0, 0, 0}, {1, 1, 1}}, ray.origin, ray.direction);
    if (!inside) return;
    t_ = inside->begin;
    t_end_ = inside->end;
    t_ += jitter * march_step(settings_, t_);
    for (int axis = 0; axis < 3; ++axis) {
      inverse_[axis] = ray.direction[axis] == 0 ? std::numeric_limits<float>::max() : 1.0f / ray.direction[axis];
    }
  }

  /// The next sample in occupied space; false at the end of the ray.
  bool next(RaySample& sample) {
    while (t_ < t_end_) {
      const Vec3f p = ray_.at(t_);
      const int cascade = grid_->cascade_of(p);
      const float dt = march_step(settings_, t_);
      if (grid_->occupied(cascade, p)) {
        sample = {t_, dt};
        t_ += dt;
        return true;
      }
      const float side =
          grid_->block_occupied(cascade, p) ? grid_->cell_side(cascade) : 8.0f * grid_->cell_side(cascade);
      leave_cell(p, side, dt);
    }
    return false;
  }

 private:
  /// Steps on until the aligned cube of the given side around `p` is left.
  void leave_cell(Vec3f p, float side, float dt) {
    float exit = std::numeric_limits<float>::max();
    for (int axis = 0; axis < 3; ++axis) {
      const float in_cells = (p[axis] - 0.5f) / side;
      const float face = (inverse_[axis] > 0 ? std::floor(in_cells) + 1.0f : std::floor(in_cells)) * side + 0.5f;
      exit = std::min(exit, (face - p[axis]) * inverse_[axis]);
    }
    const float target = t_ + std::max(exit, 0.0f);
    if (settings_.cone_angle == 0) {
      t_ += dt * std::max(1.0f, std::ceil((target - t_) / dt));
    } else {
      do t_ += march_step(settings_, t_);
      while (t_ < target);
    }
  }

  const OccupancyGrid* grid_ = nullptr;
  MarchSettings settings_;
  Ray ray_{};
  Vec3f inverse_{};
  float t_ = 0, t_end_ = -1;
};

}  // namespace cnerf
