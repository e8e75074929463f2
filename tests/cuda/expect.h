#pragma once
/// What the self-test says about a comparison.

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "src/engine/state.h"

namespace cnerf::test {

/// Prints a line and counts failures.
void expect(bool holds, const std::string& what, double value, double bound);
inline void expect_below(const std::string& what, double value, double bound) {
  expect(value < bound, what, value, bound);  // false for NaN
}
[[nodiscard]] int failures();

/// |a - b| / |b|
template <typename A, typename B>
double relative_distance(const A& a, const B& b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    difference += (double(a[i]) - double(b[i])) * (double(a[i]) - double(b[i]));
    size += double(b[i]) * double(b[i]);
  }
  return std::sqrt(difference / std::max(size, 1e-300));
}
/// Bounds a gradient's distance, and shows that a flipped one would be noticed.
void expect_gradient(const std::string& what, const std::vector<float>& found, const std::vector<float>& expected,
                     double bound);

[[nodiscard]] inline std::span<const float> floats_of(const StatePiece& piece) {
  return {reinterpret_cast<const float*>(piece.bytes.data()), piece.bytes.size() / sizeof(float)};
}

/// Copies the state of one engine into another, as a snapshot does.
template <typename Engine>
void copy_state(Engine& from, Engine& to) {
  const std::vector<StatePiece> source = from.state(), target = to.state();
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (source[i].name != target[i].name || source[i].bytes.size() != target[i].bytes.size()) {
      expect(false, "state piece " + source[i].name, 0, 0);
      continue;
    }
    std::copy(source[i].bytes.begin(), source[i].bytes.end(), target[i].bytes.begin());
  }
  to.state_loaded();
}

}  // namespace cnerf::test
