#pragma once
/// One harness of operations for every back end: an operation says what it computes, what is expected and how close the
/// back ends have to come.

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "src/engine/engines.h"
#include "tests/support/isa.h"

namespace cnerf::test {

/// Where operations run.
struct Backend {
  std::string name;
  std::optional<IsaLevel> isa;  ///< of the processor; nothing: the GPU

  [[nodiscard]] bool is_gpu() const { return !isa; }
  /// @throws DeviceError  where there is no such GPU
  [[nodiscard]] const Engines& engines() const { return engines_for(is_gpu() ? "cuda" : "cpu"); }
  /// An engine of this back end.  @param make  (Engines) -> engine
  template <typename Make>
  [[nodiscard]] auto make(Make&& make) const {
    std::optional<ScopedIsa> scope;
    if (isa) scope.emplace(*isa);
    return make(engines());
  }
};

/// A named array that an operation computes.
struct Result {
  std::string name;
  std::vector<double> values;
};

enum class Measure {
  kRelative,      ///< |found - expected| / |expected|
  kGradient,      ///< the same, and a flipped one has to be noticed
  kPercentile99,  ///< of the differences of elements: few of them may be anywhere
};
/// How far a result may be from the expected one.
struct Bound {
  std::string result;
  double processor = 0;  ///< between instruction sets: another order of sums, fused multiply-adds
  double gpu = 0;        ///< weights and activations are rounded to 16 bits, gradients to bfloat16
  Measure measure = Measure::kRelative;
};

struct Op {
  std::string name;
  std::function<std::vector<Result>(const Backend&)> run;
  std::function<std::vector<Result>()> expected;  ///< empty: what the generic processor computes
  std::vector<Bound> bounds;
  bool is_gpu_only = false;  ///< on the processor there is nothing to compare

  friend void PrintTo(const Op& op, std::ostream* out) { *out << op.name; }
};

[[nodiscard]] inline Backend reference_backend() {
  return {"generic", IsaLevel::kGeneric};
}

/// |found - expected| / |expected|
template <typename Found, typename Expected>
[[nodiscard]] double relative_distance(const Found& found, const Expected& expected) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    difference += (double(found[i]) - double(expected[i])) * (double(found[i]) - double(expected[i]));
    size += double(expected[i]) * double(expected[i]);
  }
  return std::sqrt(difference / std::max(size, 1e-300));
}

template <typename Values>
[[nodiscard]] std::vector<double> doubles(const Values& values) {
  return {values.begin(), values.end()};
}

/// Hash grid and optimiser.
[[nodiscard]] std::vector<Op> kernel_ops();
/// The engine of stage 1.
[[nodiscard]] std::vector<Op> luminance_ops();
/// The engines of stage 2.
[[nodiscard]] std::vector<Op> color_ops();

}  // namespace cnerf::test
