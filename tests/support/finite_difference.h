#pragma once
/// Central differences in double, and how far an analytic gradient is from them.

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace cnerf::test {

/// d f / d parameters[i] by central differences, for the chosen indices.
inline std::vector<double> central_difference(std::vector<double> parameters, const std::vector<std::size_t>& indices,
                                              double step, const std::function<double(const std::vector<double>&)>& f) {
  std::vector<double> gradient;
  for (const std::size_t i : indices) {
    const double middle = parameters[i];
    parameters[i] = middle + step;
    const double above = f(parameters);
    parameters[i] = middle - step;
    const double below = f(parameters);
    parameters[i] = middle;
    gradient.push_back((above - below) / (2 * step));
  }
  return gradient;
}

/// Largest difference over the larger of the gradient's own scale and each pair's magnitude.
template <typename A, typename B>
double worst_relative_error(const std::vector<A>& a, const std::vector<B>& b) {
  double scale = 0;
  for (const B& value : b) scale = std::max(scale, std::abs(double(value)));
  double worst = a.size() == b.size() ? 0 : 1e30;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    worst = std::max(worst, std::abs(double(a[i]) - double(b[i])) / std::max(1e-3 * scale, std::abs(double(b[i]))));
  }
  return worst;
}

/// Norm of the difference over the norm of `b`.
template <typename A, typename B>
double relative_distance(const std::vector<A>& a, const std::vector<B>& b) {
  double difference = 0, norm = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    difference += (double(a[i]) - double(b[i])) * (double(a[i]) - double(b[i]));
    norm += double(b[i]) * double(b[i]);
  }
  return a.size() == b.size() ? std::sqrt(difference / std::max(norm, 1e-300)) : 1e30;
}

}  // namespace cnerf::test
