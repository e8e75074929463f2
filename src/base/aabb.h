#pragma once
/// Axis-aligned boxes and their intersection with rays.

#include <algorithm>
#include <limits>
#include <optional>

#include "src/base/vec3.h"

namespace cnerf {

template <typename Real>
struct Interval {
  Real begin{}, end{};
};

template <typename Real>
struct Aabb {
  Vec3<Real> min{}, max{};

  /// A box that holds nothing; `grow` makes it hold points.
  static constexpr Aabb empty() {
    constexpr Real inf = std::numeric_limits<Real>::infinity();
    return {{inf, inf, inf}, {-inf, -inf, -inf}};
  }
  [[nodiscard]] CNERF_HD constexpr Vec3<Real> size() const { return max - min; }
  [[nodiscard]] CNERF_HD constexpr Vec3<Real> centre() const { return (min + max) * Real(0.5); }
  [[nodiscard]] CNERF_HD constexpr bool contains(Vec3<Real> p) const {
    return p.x >= min.x && p.x <= max.x && p.y >= min.y && p.y <= max.y && p.z >= min.z && p.z <= max.z;
  }
  constexpr void grow(Vec3<Real> p) {
    for (int axis = 0; axis < 3; ++axis) {
      min[axis] = std::min(min[axis], p[axis]);
      max[axis] = std::max(max[axis], p[axis]);
    }
  }
  friend constexpr bool operator==(const Aabb&, const Aabb&) = default;
};

using Aabbf = Aabb<float>;
using Aabbd = Aabb<double>;

/// The part `[begin, end]`, begin >= 0, of the ray `origin + t * direction` inside the box; nothing on a miss.
/// Zero components of the direction are fine: the ray then misses unless its origin lies between the two planes.
template <typename Real>
CNERF_HD std::optional<Interval<Real>> intersect(const Aabb<Real>& box, Vec3<Real> origin, Vec3<Real> direction) {
  Real begin = 0;
  Real end = std::numeric_limits<Real>::max();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == Real(0)) {
      if (origin[axis] < box.min[axis] || origin[axis] > box.max[axis]) return std::nullopt;
      continue;
    }
    const Real inverse = Real(1) / direction[axis];
    const Real a = (box.min[axis] - origin[axis]) * inverse;
    const Real b = (box.max[axis] - origin[axis]) * inverse;
    if (!(a <= b || b <= a)) return std::nullopt;  // the ray is of no numbers
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  if (begin >= end) return std::nullopt;
  return Interval<Real>{begin, end};
}

}  // namespace cnerf
