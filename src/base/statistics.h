#pragma once
/// Order statistics. One rule: between two values in order, what lies between them is a straight line.

#include <algorithm>
#include <cstddef>
#include <vector>

#include "src/base/check.h"

namespace cnerf {

/// What a share of the values lies below: 0 gives the least, 1 the largest. The place share * (n - 1) in their order;
/// a place between two values is interpolated.
/// @param values  at least one
template <typename Real>
[[nodiscard]] Real quantile(std::vector<Real> values, double share) {
  CNERF_CHECK(!values.empty(), "a quantile of nothing");
  const double place = share * double(values.size() - 1);
  const auto below = values.begin() + std::ptrdiff_t(place);
  std::nth_element(values.begin(), below, values.end());
  const double part = place - double(below - values.begin());
  if (part == 0) return *below;
  return Real(*below + part * (*std::min_element(below + 1, values.end()) - *below));
}

/// The value in the middle; the mean of the two in the middle where their number is even.
template <typename Real>
[[nodiscard]] Real median(std::vector<Real> values) {
  return quantile(std::move(values), 0.5);
}

}  // namespace cnerf
