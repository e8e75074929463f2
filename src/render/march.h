#pragma once
/// Steps along a ray through occupied space. The points a ray may be sampled at form a lattice, by number, the same on
/// every device: RayMarcher walks them one after another, a kernel asks for as many at once as lanes share the ray.

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

/// The points by number. Steps are constant at first, then geometric, then constant again.
class MarchLattice {
 public:
  MarchLattice() = default;
  /// @param begin   where the ray enters the box
  /// @param jitter  in [0, 1): shifts the lattice by this share of its first step
  CNERF_HD MarchLattice(const MarchSettings& settings, float begin, float jitter) : settings_(settings) {
    first_ = begin + jitter * step(begin);
    if (settings.cone_angle <= 0) return;
    const float growing = settings.dt_min / settings.cone_angle;   // from here on steps grow
    const float constant = settings.dt_max / settings.cone_angle;  // and from here on they do no more
    log2_growth_ = std::log2(1.0f + settings.cone_angle);
    growing_at_ = first_ >= growing ? 0 : int(std::ceil((growing - first_) / settings.dt_min));
    growing_t_ = first_ + float(growing_at_) * settings.dt_min;
    constant_at_ = growing_at_;
    if (growing_t_ < constant) constant_at_ += int(std::ceil(std::log2(constant / growing_t_) / log2_growth_));
    constant_t_ = growing_t_ * std::exp2(float(constant_at_ - growing_at_) * log2_growth_);
  }

  /// Length of the step that starts at t.
  [[nodiscard]] CNERF_HD float step(float t) const { return march_step(settings_, t); }
  /// The index-th point.
  [[nodiscard]] CNERF_HD float t_at(int index) const {
    if (settings_.cone_angle <= 0 || index < growing_at_) return first_ + float(index) * settings_.dt_min;
    if (index < constant_at_) return growing_t_ * std::exp2(float(index - growing_at_) * log2_growth_);
    return constant_t_ + float(index - constant_at_) * settings_.dt_max;
  }
  /// Number of the first point at t or behind it, but for rounding.
  [[nodiscard]] CNERF_HD int index_at(float t) const {
    if (settings_.cone_angle <= 0 || t < growing_t_) return int(std::ceil((t - first_) / settings_.dt_min));
    if (t < constant_t_) return growing_at_ + int(std::ceil(std::log2(t / growing_t_) / log2_growth_));
    return constant_at_ + int(std::ceil((t - constant_t_) / settings_.dt_max));
  }

 private:
  MarchSettings settings_;
  float first_ = 0, growing_t_ = 0, constant_t_ = 0, log2_growth_ = 0;
  int growing_at_ = 0, constant_at_ = 0;
};

/// Walks one ray's lattice. `next` yields the occupied samples in order, so that the caller may stop at any time.
class RayMarcher {
 public:
  RayMarcher() = default;
  /// @param jitter  in [0, 1), see MarchLattice
  RayMarcher(const OccupancyGrid& grid, const MarchSettings& settings, const Ray& ray, float jitter)
      : grid_(&grid), ray_(ray) {
    const auto inside = intersect(Aabbf{{0, 0, 0}, {1, 1, 1}}, ray.origin, ray.direction);
    if (!inside) return;
    lattice_ = {settings, inside->begin, jitter};
    t_end_ = inside->end;
    for (int axis = 0; axis < 3; ++axis) {
      inverse_[axis] = ray.direction[axis] == 0 ? std::numeric_limits<float>::max() : 1.0f / ray.direction[axis];
    }
  }

  /// The next sample in occupied space; false at the end of the ray.
  bool next(RaySample& sample) {
    while (true) {
      const float t = lattice_.t_at(index_);
      if (!(t < t_end_)) return false;
      const Vec3f p = ray_.at(t);
      const int cascade = grid_->cascade_of(p);
      if (grid_->occupied(cascade, p)) {
        sample = {t, lattice_.step(t)};
        ++index_;
        return true;
      }
      const float side =
          grid_->block_occupied(cascade, p) ? grid_->cell_side(cascade) : 8.0f * grid_->cell_side(cascade);
      index_ = std::max(index_ + 1, lattice_.index_at(t + distance_to_exit(p, side)));
    }
  }

 private:
  /// Along the ray, from `p` to where it leaves the aligned cube of the given side around it.
  [[nodiscard]] float distance_to_exit(Vec3f p, float side) const {
    float exit = std::numeric_limits<float>::max();
    for (int axis = 0; axis < 3; ++axis) {
      const float in_cells = (p[axis] - 0.5f) / side;
      const float face = (inverse_[axis] > 0 ? std::floor(in_cells) + 1.0f : std::floor(in_cells)) * side + 0.5f;
      exit = std::min(exit, (face - p[axis]) * inverse_[axis]);
    }
    return std::max(exit, 0.0f);
  }

  const OccupancyGrid* grid_ = nullptr;
  Ray ray_{};
  Vec3f inverse_{};
  MarchLattice lattice_;
  float t_end_ = -1;
  int index_ = 0;
};

}  // namespace cnerf
