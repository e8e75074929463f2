#pragma once
/// Order statistics, with linear interpolation between neighbouring values.

#include <algorithm>
#include <cstddef>
#include <vector>

#include "src/base/check.h"

namespace cnerf {

/// The value below which `share` of the values lie: 0 gives the smallest, 1 the largest. It is the one at position
/// share * (n - 1) of the sorted values, interpolated between two of them.
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

/// The middle value; of an even number of values the mean of the two middle ones.
template <typename Real>
[[nodiscard]] Real median(std::vector<Real> values) {
  return quantile(std::move(values), 0.5);
}

/// The factor that brings some values closest to others, by least squares.
class GainFit {
 public:
  void add(double value, double wanted) {
    both_ += value * wanted;
    own_ += value * value;
  }
  [[nodiscard]] double gain() const { return own_ > 0 ? both_ / own_ : 1; }

 private:
  double both_ = 0, own_ = 0;
};

}  // namespace cnerf
