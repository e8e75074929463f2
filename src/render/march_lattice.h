#pragma once
/// The points a ray may be sampled at, by number. RayMarcher walks them one after another; a kernel asks for as
/// many at once as lanes share the ray. Steps are dt(t) = clamp(cone_angle t, dt_min, dt_max): constant, then
/// geometric, then constant again.

#include <cmath>

#include "src/base/host_device.h"
#include "src/render/march.h"

namespace cnerf {

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

 private:
  MarchSettings settings_;
  float first_ = 0, growing_t_ = 0, constant_t_ = 0, log2_growth_ = 0;
  int growing_at_ = 0, constant_at_ = 0;
};

}  // namespace cnerf
